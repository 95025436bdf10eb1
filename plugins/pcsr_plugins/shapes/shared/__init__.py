"""What several sources of shapes share: random draws, splits, mesh checks, cleaning of surfaces."""
