"""The content security policy of a page: what it may run, and that it asks for nothing from anywhere."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence

# Figures stand in the page as data; scripts and styles are known by their hashes.
_POLICY = (
    "default-src 'none'; script-src {scripts}; style-src {styles}; img-src data:; base-uri 'none'; form-action 'none'"
)


def page_policy(scripts: Sequence[str], styles: Sequence[str]) -> str:
    """The policy under which these scripts and styles of a page hold, and no others; no request leaves it."""
    return _POLICY.format(scripts=_hashes(scripts), styles=_hashes(styles))


def _hashes(texts: Sequence[str]) -> str:
    found = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{one}'" for one in found) or "'none'"
