"""Settings for every test."""

from hypothesis import settings

# How long an example takes depends on who else uses the machine, so no example fails for being slow.
settings.register_profile("pcsr", deadline=None)
settings.load_profile("pcsr")
