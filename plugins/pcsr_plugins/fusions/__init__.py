"""Fusions: touch into the visual features."""
