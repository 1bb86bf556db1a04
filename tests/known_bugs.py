"""Bugs that tests have found and that are not mended yet: expected failures.

`xfail_strict` is on, so that a bug that is mended fails its test until it is taken off the list.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import pytest


def bug(reason: str) -> pytest.MarkDecorator:
    """Marks a test as failing, for this reason."""
    return pytest.mark.xfail(reason=reason)


def marked(cases: Iterable[Any], bugs: Mapping[Any, str]) -> list[Any]:
    """Cases for `parametrize`; those in `bugs` are expected to fail, for the reason given there."""
    cases = list(cases)
    assert set(bugs) <= set(cases), "a bug of a case that is not tested"
    return [pytest.param(case, marks=bug(bugs[case])) if case in bugs else case for case in cases]
