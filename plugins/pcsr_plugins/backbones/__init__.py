"""Backbones: they refine the fused features."""
