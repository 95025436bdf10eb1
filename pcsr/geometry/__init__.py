"""Geometry of point clouds: neighbours, orders, sampling, frames, interpolation and ray casting."""
