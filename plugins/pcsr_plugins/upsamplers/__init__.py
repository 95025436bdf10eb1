"""Upsamplers: features to more points."""
