"""What a page carries, decoded without the library."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np


def page_data(file):
    """The data of a page: arrays flat, as numpy has them."""
    page = file.read_text(encoding="utf-8")
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    (packed,) = re.findall(r'<script type="text/plain" id="arrays">(.*?)</script>', page, re.DOTALL)
    block = zlib.decompress(base64.b64decode(packed))

    def found(entry):
        if "array_kind" not in entry:
            return entry
        return np.frombuffer(block, entry["array_kind"], entry["length"], entry["start"])

    return json.loads(text, object_hook=found)
