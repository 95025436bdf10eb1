"""Baselines: upsampling without learning."""
