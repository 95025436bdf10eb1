"""Clouds as `pcsr view` shows them: their colours, origin, thinning and common frame."""
