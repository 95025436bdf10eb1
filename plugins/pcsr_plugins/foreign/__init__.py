"""Published weights of others, put into our parts."""
