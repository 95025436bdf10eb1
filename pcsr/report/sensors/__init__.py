"""Pictures of what camera-based tactile sensors see and measure."""
