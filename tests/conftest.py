"""Property tests take the same examples every time, or new ones with `pytest --hypothesis-profile=explore`."""

from hypothesis import settings

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("explore", max_examples=1000, deadline=None)
settings.load_profile("same")
