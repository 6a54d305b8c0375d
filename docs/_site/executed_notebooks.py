"""Notebooks are committed with their outputs. Here they are executed, cleaned, compared with those, and written.

`make notebooks` executes all of them and writes their outputs into `notebooks/`. The build of the site executes them
once, too, shows what comes out, and warns where a number is no longer the one committed.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import nbformat
from PIL import Image

ROOT = Path(__file__).parents[2]
NOTEBOOKS = ROOT / "notebooks"
# The longest notebook plans a dozen motions; a busy machine takes minutes for it [s].
_TIMEOUT = 1800
# What agrees: one unit of the last digit shown, or 1e-7, absolute and relative. The library's tolerance is 1e-9 rad at
# all times, which is 6e-8 degrees; optima are found to about as many digits.
_AGREES = 1e-7
# Numbers below this are sizes of rounding or estimates of errors: another processor has others. Both must be below.
_SIZE = 1e-6
# Most bytes of a picture, and of a page in three dimensions.
MOST_OF_A_PICTURE = 100_000
MOST_OF_A_PAGE = 300_000
# Rounds that move the colours of a picture to the means of what they stand for; without, smooth maps have steps.
_MEANS = 4
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_FRAME = re.compile(r'srcdoc="[^"]*"')
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def notebooks() -> list[Path]:
    """All notebooks, in the order of their names."""
    return sorted(NOTEBOOKS.glob("*.ipynb"))


def read(path: Path) -> Any:
    """A notebook from its file."""
    return nbformat.read(path, as_version=4)


def write(notebook: Any, path: Path) -> None:
    """Write it as the committed ones are written, if that changes the file."""
    text = nbformat.writes(notebook) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def quiet_kernels(folder: Path) -> None:
    """Start kernels with settings of their own, not the user's.

    Neither what they say of their transport is a warning, nor what the library logs: that it compiles on a new machine.
    """
    profile = folder / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    settings = [
        "c = get_config()",
        "c.Application.log_level = 40",
        "c.IPKernelApp.exec_lines = ['import logging', 'logging.getLogger(\"shapephase\").setLevel(logging.ERROR)']",
    ]
    (profile / "ipython_kernel_config.py").write_text("\n".join(settings) + "\n", encoding="utf-8")
    os.environ["IPYTHONDIR"] = str(folder)


def execute(path: Path) -> Any:
    """A notebook executed in an empty folder and in its own kernel, without what differs from run to run."""
    from nbclient import NotebookClient

    notebook = read(path)
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(notebook, timeout=_TIMEOUT, kernel_name="python3", record_timing=False)
        client.resources = {"metadata": {"path": folder}}
        client.execute()
    return cleaned(notebook)


def execute_all(paths: list[Path], then: Callable[[Path, Any], None]) -> None:
    """Execute them, as many at a time as there are processors, and pass on each as it is done."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    quiet_kernels(ROOT / "docs" / "_build" / "ipython")
    largest_first = sorted(paths, key=lambda path: -_work(path))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for path, notebook in zip(largest_first, pool.map(execute, largest_first)):
            then(path, notebook)


def _work(path: Path) -> int:
    """How long a notebook takes, roughly: planning takes longest."""
    text = path.read_text(encoding="utf-8")
    return 20 * text.count("plan_reorientation(") + text.count("reconstruct(")


def cleaned(notebook: Any) -> Any:
    """The notebook with the metadata that a reader needs, and no other."""
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    count = 0
    for cell in notebook.cells:
        cell.metadata = {name: cell.metadata[name] for name in ("tags", "jupyter") if name in cell.metadata}
        if cell.cell_type == "code":
            # What installs the library elsewhere is not counted: readers of the site do not see it.
            installs = "colab" in cell.metadata.get("tags", ())
            count += not installs
            cell.execution_count = None if installs else count
            cell.outputs = _merged(cell.outputs)
            for output in cell.outputs:
                output.pop("metadata", None)
                if "execution_count" in output:
                    output.execution_count = count
                if "data" in output:
                    output.metadata = {}
                    if "image/png" in output.data:
                        output.data["image/png"] = _light(output.data["image/png"])
    return notebook


def _light(picture: str) -> str:
    """A picture with a table of 256 colours: a third of the bytes."""
    image, kept = Image.open(io.BytesIO(b64decode(picture))), io.BytesIO()
    if image.mode == "P":
        return picture
    light = image.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, _MEANS, dither=Image.Dither.NONE)
    light.save(kept, "png", optimize=True)
    return b64encode(kept.getvalue()).decode()


def _merged(outputs: list[Any]) -> list[Any]:
    """Outputs in which what is printed in several pieces is one."""
    merged: list[Any] = []
    for output in outputs:
        last = merged[-1] if merged else None
        if last and output.output_type == last.output_type == "stream" and output.name == last.name:
            last.text += output.text
        else:
            merged.append(output)
    return merged


def faults(notebook: Any) -> Iterator[str]:
    """What a committed notebook may not have: warnings, addresses in memory, large pictures; code without outputs."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    if not outputs:
        yield "no outputs: run `make notebooks`"
    for output in outputs:
        if output.output_type == "error" or output.get("name") == "stderr":
            yield f"an error or a warning: {output.get('text', output.get('evalue'))[:200]}"
        data = output.get("data", {})
        if found := _ADDRESS.search(output.get("text", "") + data.get("text/plain", "")):
            yield f"an address in memory:{found[0]}"
        if (size := len(b64decode(data.get("image/png", "")))) > MOST_OF_A_PICTURE:
            yield f"a picture of {size} bytes"
        if (size := len(data.get("text/html", ""))) > MOST_OF_A_PAGE:
            yield f"a page of {size} bytes"


def disagreements(committed: Any, found: Any) -> Iterator[str]:
    """Where outputs differ by more than the digits shown, or by more than the library's tolerance."""
    if len(committed.cells) != len(found.cells):
        yield "other cells"
        return
    for place, (old, new) in enumerate(zip(committed.cells, found.cells)):
        before, after = _texts(old), _texts(new)
        if [kind for kind, _ in before] != [kind for kind, _ in after]:
            yield f"cell {place}: other outputs"
            continue
        for (_, said), (_, says) in zip(before, after):
            if difference := _difference(said, says):
                yield f"cell {place}: {difference}"


def _texts(cell: Any) -> list[tuple[str, str]]:
    """Kind and text of each output; of pictures the kind alone, of a frame all but the page in it."""
    texts = []
    for output in cell.get("outputs", ()):
        texts += [("stream", output.text)] if output.output_type == "stream" else []
        for kind, data in sorted(output.get("data", {}).items()):
            texts.append((kind, _FRAME.sub("", data) if kind.startswith("text/") else ""))
    return texts


def _difference(said: str, says: str) -> str:
    """The first number or word in which two texts differ; none: an empty text."""
    if " ".join(_NUMBER.sub("#", said).split()) != " ".join(_NUMBER.sub("#", says).split()):
        return f"{said.strip()[:200]!r} was, {says.strip()[:200]!r} is"
    for before, after in zip(_NUMBER.findall(said), _NUMBER.findall(says), strict=True):
        if not agree(before, after):
            return f"{before} was, {after} is, in {says.strip()[:100]!r}"
    return ""


def agree(before: str, after: str) -> bool:
    """Whether two numbers, as they are printed, are the same but for rounding.

    Examples
    --------
    >>> agree("179.999999", "180.000000"), agree("12.4", "12.6"), agree("3.1e-12", "0.0e+00")
    (True, False, True)
    """
    first, second = (float(text.replace("−", "-")) for text in (before, after))
    if max(abs(first), abs(second)) < _SIZE:
        return True
    # Half a unit is lost when the numbers are read back from their digits.
    unit = 1.5 * max(_last_digit(before), _last_digit(after)) if "." in before + after else 0.0
    return abs(first - second) <= max(unit, _AGREES * max(1.0, abs(first)))


def _last_digit(text: str) -> float:
    """The unit of the last digit of a number."""
    mantissa, _, power = text.lower().partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def shown(text: str) -> str:
    """A notebook's text on the site, where pages of `docs/` are two folders up."""
    return text.replace("](../docs/", "](../../").replace("](../notebooks/", "](")


def write_pages(folder: Path) -> Iterator[str]:
    """Write executed notebooks as pages of the site, and yield where they disagree with those committed.

    What is executed is kept beside the pages: without a change of the library or a notebook nothing is executed anew.
    """
    folder.mkdir(exist_ok=True)
    wanted = notebooks()
    for old in set(folder.glob("*.ipynb")) - {folder / path.name for path in wanted}:
        old.unlink()
    made_of = {path: f"{library_digest()} {_digest([path])}" for path in wanted}
    changed = [path for path in wanted if _made_of(folder / path.name) != made_of[path]]
    said: list[str] = []

    def page(path: Path, notebook: Any) -> None:
        said.extend(f"{path.name}: {text}" for text in (*faults(notebook), *disagreements(read(path), notebook)))
        for cell in notebook.cells:
            if cell.cell_type == "markdown":
                cell.source = shown(cell.source)
        notebook.metadata["made_of"] = made_of[path]
        write(notebook, folder / path.name)

    execute_all(changed, page)
    yield from said


def library_digest() -> str:
    """What the library is, as one word: what was executed with another has to be executed anew."""
    return _digest(sorted(file for folder in ("src", "robots") for file in (ROOT / folder).rglob("*.*")))


def _digest(files: list[Path]) -> str:
    found = hashlib.sha256()
    for file in files:
        if "__pycache__" not in file.parts and file.is_file():
            found.update(file.read_bytes())
    return found.hexdigest()


def _made_of(page: Path) -> str:
    return read(page).metadata.get("made_of", "") if page.exists() else ""


def main(names: list[str]) -> int:
    """Execute the notebooks whose names begin so, or all, and write them; returns how many have faults."""
    chosen = [path for path in notebooks() if not names or path.name.startswith(tuple(names))]
    wrong: list[str] = []

    def renew(path: Path, notebook: Any) -> None:
        for text in disagreements(read(path), notebook):
            print(f"{path.name}: {text}")
        wrong.extend(f"{path.name}: {text}" for text in faults(notebook))
        write(notebook, path)

    execute_all(chosen, renew)
    print("\n".join([*wrong, f"{len(chosen)} notebooks written"]))
    return len(wrong)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
