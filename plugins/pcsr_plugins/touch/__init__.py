"""Touch sources: simulated or recorded."""
