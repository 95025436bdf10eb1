"""What a recording of touches holds, and what is odd about it."""
