"""Points in space: neighbours, orders, samples, frames, interpolation. Pure functions, no state."""
