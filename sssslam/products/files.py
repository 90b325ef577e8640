"""How a product reaches the disk: whole or not at all."""

import logging
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

_log = logging.getLogger(__name__)


def atomic_write(path: Path, content: str | bytes) -> None:
    """Write a file under a temporary name beside it, then rename it.

    Parameters
    ----------
    path : Path
        The file; whatever lies there is replaced in one step.
    content : str or bytes
        All of it; text is written as UTF-8 with its line ends as they are.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def staged(out: Path, owned: Sequence[str], last: str) -> Iterator[Path]:
    """A hidden folder inside OUT whose files become OUT's when the block ends well.

    Files of an earlier run that match `owned` and are not written again are removed; a block that fails or is
    interrupted leaves OUT as it was. Anything else in OUT is left alone.

    Parameters
    ----------
    out : Path
        The folder of a run; made if it does not exist.
    owned : sequence of str
        Glob patterns, relative to OUT, of the files that runs write.
    last : str
        The file that is removed first and put in place last: while it exists, the others belong to its run.

    Yields
    ------
    stage : Path
        The folder to write into.
    """
    stage = _make_stage(out)
    try:
        yield stage
        _publish(stage, out, owned, last)
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _make_stage(out: Path) -> Path:
    try:
        out.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=".sssslam-", dir=out))
    except (FileExistsError, NotADirectoryError):
        raise ValueError(f"the output must be a folder, got {out} which is or lies under a file") from None
    except OSError as error:
        raise ValueError(f"the output must be a folder that can be written, got {out} ({error.strerror})") from None


def _publish(stage: Path, out: Path, owned: Sequence[str], last: str) -> None:
    written = sorted(path.relative_to(stage) for path in stage.rglob("*") if path.is_file())
    stale = {path for pattern in owned for path in out.glob(pattern)} - {out / name for name in written}
    (out / last).unlink(missing_ok=True)
    for path in sorted(stale):
        path.unlink()
    for name in sorted(written, key=lambda name: (name == Path(last), name)):
        (out / name).parent.mkdir(exist_ok=True)
        os.replace(stage / name, out / name)
    _log.debug("wrote %d files to %s, removed %d of an earlier run", len(written), out, len(stale))
