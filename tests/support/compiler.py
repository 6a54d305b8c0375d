"""The mark of tests whose truth is computed by compiled C."""

import os
import shutil

import pytest

needs_compiler = pytest.mark.skipif(
    shutil.which(os.environ.get("CC", "cc").split()[0]) is None,
    reason="the truth in extended precision needs a C compiler",
)
