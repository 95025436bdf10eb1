"""Figures as PNG files, drawn by matplotlib: those of the paper, and line charts."""
