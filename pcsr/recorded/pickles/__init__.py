"""Safe reading of pickled arrays in recordings: nothing that a pickle names is imported or called."""
