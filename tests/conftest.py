from hypothesis import settings

# Kernels compile on first call, so no deadline. Equal examples in every run: a red test stays red.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=2000)
settings.load_profile("repeatable")
