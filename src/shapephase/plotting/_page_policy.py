"""The content security policy of a page: what it may run, and that it asks for nothing from anywhere."""

from __future__ import annotations

import base64
import hashlib
from html import escape
from html.parser import HTMLParser

import numpy as np
import zstandard

# Digits of base 88, in which viser packs its viewer: what needs no escape in an attribute.
_DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
# Five such digits are four bytes.
_DIGITS_A_WORD = 5
_BYTES_A_WORD = 4
# The viewer decompresses with WebAssembly, styles what it shows by itself, and carries its images, code and workers
# within; it may have no more.
_POLICY = (
    "default-src 'none'; script-src {scripts} 'wasm-unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'"
)
# The viewer sorts clouds of splats with code that it makes of strings. It may not, and says so although none is shown.
_QUIET = (
    "<script>addEventListener('unhandledrejection', "
    "event => { if (event.reason instanceof EvalError) event.preventDefault(); });</script>"
)


def page_policy(page: str) -> str:
    """The policy under which the scripts that are in a page run, by their hashes, and no others; no request leaves it.

    Of a viewer that is packed in another way than viser 1.1 does, any script in the page may run.
    """
    scripts = _scripts_of(page)
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(text).digest()).decode()}'" for text in scripts or ())
    return _POLICY.format(scripts=hashes or "'unsafe-inline'")


def guarded(page: str) -> str:
    """A page of viser with its policy, which stands before all that it rules."""
    begin = page.index("<head>") + len("<head>")
    page = page[:begin] + _QUIET + page[begin:]
    return page[:begin] + policy_element(page_policy(page)) + page[begin:]


def policy_element(policy: str) -> str:
    """A policy as an element of a page's head."""
    return f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{escape(policy)}">'


def _scripts_of(page: str) -> list[bytes] | None:
    """The scripts in a page, also that which the packed viewer unpacks; None if it cannot be unpacked here."""
    reader = _ScriptReader()
    try:
        reader.feed(page)
        packed = [_unpacked(*attributes) for attributes in reader.packed]
    except (ValueError, KeyError, zstandard.ZstdError):
        return None
    return [text.encode() for text in reader.texts] + packed


class _ScriptReader(HTMLParser):
    """Collects the scripts of a page, and what is packed into their attributes.

    Attributes
    ----------
    texts : of the scripts that stand in the page
    packed : digits, bytes of the style and bytes of the script that are packed in them
    """

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.texts: list[str] = []
        self.packed: list[tuple[str, int, int]] = []
        self._within = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._within = tag == "script"
        if self._within:
            self.texts.append("")
            found = {name: value or "" for name, value in attrs}
            if "data-p" in found:
                self.packed.append((found["data-p"], int(found["data-ss"]), int(found["data-cs"])))

    def handle_endtag(self, tag: str) -> None:
        self._within = self._within and tag != "script"

    def handle_data(self, data: str) -> None:
        if self._within:
            self.texts[-1] += data


def _unpacked(digits: str, style: int, script: int) -> bytes:
    """The script that viser's viewer unpacks from its digits, after a style. Raises ValueError, ZstdError."""
    values = np.frombuffer(digits.encode("ascii"), np.uint8)
    table = np.full(256, -1)
    table[np.frombuffer(_DIGITS.encode("ascii"), np.uint8)] = np.arange(len(_DIGITS))
    places = table[values]
    if np.any(places < 0):
        raise ValueError("a letter that is no digit of base 88")
    whole, rest = divmod(len(places), _DIGITS_A_WORD)
    powers = len(_DIGITS) ** np.arange(_DIGITS_A_WORD)[::-1]
    content = (places[: len(places) - rest].reshape(whole, -1) @ powers).astype(">u4").tobytes()
    if rest:
        last = int(places[-rest:] @ powers[-rest:])
        content += last.to_bytes(rest - 1, "big")
    unpacked = zstandard.ZstdDecompressor().decompress(content, max_output_size=style + script)
    if len(unpacked) != style + script:
        raise ValueError("another length than is said")
    return unpacked[style:]
