"""Records for what sensors give."""
