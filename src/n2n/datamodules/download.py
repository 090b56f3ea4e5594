"""Download one file: resumed where it broke off, whole or absent, the same as the first time."""

import hashlib
import http.client
import json
import shutil
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from n2n import __version__
from n2n.errors import InputError, OutputError
from n2n.formats import atomic_path

Report = Callable[[int, int], None]
CHECKSUMS = "n2n-checksums.json"
_BLOCK = 1 << 20
_ATTEMPTS = 3  # in a row without a single new byte


def download(url: str, path: Path, report: Report | None = None, timeout: float = 30.0) -> None:
    """Download to `path`, which appears when it is whole and equals what was downloaded there before.

    What has arrived lies beside it in a hidden `.part` file; the next call goes on from there if the server still has
    the same file and can resume. The SHA-256 of the first download is kept in `n2n-checksums.json` in the same folder.

    Args:
        url: http or https.
        path: File to write.
        report: Called with the bytes that are here and the bytes there are in all (0: unknown).
        timeout: Seconds without an answer that end an attempt.

    Raises:
        InputError: The server cannot be reached, refuses, breaks off, or sends another file than the first time.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    part, validator = path.with_name(f".{path.name}.part"), path.with_name(f".{path.name}.tag")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _transfer(url, part, validator, report or (lambda done, total: None), timeout)
        _compare(url, part, path.parent / CHECKSUMS)
        part.replace(path)
        validator.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error}); choose another folder") from error


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, 64 hex digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _transfer(url: str, part: Path, validator: Path, report: Report, timeout: float) -> None:
    """Fill the part file; go on after breaks as long as something new arrives."""
    fruitless = 0
    while True:
        before = part.stat().st_size if part.exists() else 0
        reason = _attempt(url, part, validator, report, timeout)
        if reason is None:
            return
        here = part.stat().st_size if part.exists() else 0
        fruitless = 0 if here > before else fruitless + 1
        if fruitless == _ATTEMPTS:
            raise InputError(
                f"{url}: {reason}; {here:,} bytes are kept, run the same command again to go on from there"
            )


def _attempt(url: str, part: Path, validator: Path, report: Report, timeout: float) -> str | None:
    """Ask for what is missing and append it; return why the file is not whole yet, None if it is."""
    here = part.stat().st_size if part.exists() else 0
    tag = validator.read_text() if here and validator.exists() else ""
    headers = {"User-Agent": f"n2n/{__version__}", "Accept-Encoding": "identity"}
    if tag:
        # The server sends the rest if the file is still the one of the tag, else all of the new one.
        headers |= {"Range": f"bytes={here}-", "If-Range": tag}
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=timeout) as answer:
            resumed = answer.status == http.client.PARTIAL_CONTENT
            if resumed and not answer.headers.get("Content-Range", "").startswith(f"bytes {here}-"):
                validator.unlink()
                return "the server resumed at another byte than it was asked to"
            here = here if resumed else 0
            rest = int(answer.headers.get("Content-Length") or 0)
            total = here + rest if rest else 0
            _check_space(part, rest)
            if not resumed:
                part.unlink(missing_ok=True)
            validator.write_text(_validator(answer.headers))
            return _append(answer, part, here, total, report)
    except urllib.error.HTTPError as error:
        if error.code == http.client.REQUESTED_RANGE_NOT_SATISFIABLE and tag:
            validator.unlink()
            return "the server has fewer bytes than are here"
        raise InputError(
            f"{url}: the server answers {error.code} {error.reason}; the address may have moved"
        ) from error
    except (urllib.error.URLError, http.client.HTTPException, TimeoutError, ConnectionError) as error:
        cause = getattr(error, "reason", None) or error
        if here:
            return f"the connection broke ({cause})"
        host = urllib.parse.urlsplit(url).netloc
        raise InputError(
            f"{url}: cannot reach {host} ({cause}); check the network, or download it elsewhere"
        ) from error


def _append(answer: http.client.HTTPResponse, part: Path, here: int, total: int, report: Report) -> str | None:
    with part.open("ab") as file:
        report(here, total)
        while True:
            try:
                block = answer.read(_BLOCK)
            except (http.client.HTTPException, TimeoutError, ConnectionError) as error:
                return f"the connection broke after {here:,} bytes ({error or type(error).__name__})"
            if not block:
                break
            file.write(block)
            here += len(block)
            report(here, total)
    return f"the transfer ended after {here:,} of {total:,} bytes" if total and here < total else None


def _validator(headers: http.client.HTTPMessage) -> str:
    """Return what names this version of the file; a weak tag does not, and without any a resume is not safe."""
    tag = headers.get("ETag", "")
    return headers.get("Last-Modified", "") if not tag or tag.startswith("W/") else tag


def _check_space(part: Path, needed: int) -> None:
    free = shutil.disk_usage(part.parent).free
    if needed > free:
        raise OutputError(f"{part.parent}: {needed / 1e9:.1f} GB are to come, {free / 1e9:.1f} GB are free there")


def _compare(url: str, part: Path, record: Path) -> None:
    """Keep the checksum of the first download of an address; refuse a later one that differs."""
    known: dict[str, dict] = {}
    if record.exists():
        with suppress(ValueError):
            known = json.loads(record.read_text())
        if not isinstance(known, dict):
            raise InputError(f"{record}: is no record of checksums; delete it, the next download starts a new one")
    found = {"sha256": sha256(part), "bytes": part.stat().st_size}
    if url not in known:
        with atomic_path(record) as temporary:
            temporary.write_text(json.dumps(known | {url: found}, indent=1, sort_keys=True) + "\n")
    elif known[url] != found:
        part.unlink()
        raise InputError(
            f"{url}: SHA-256 {found['sha256'][:16]}... is not the {str(known[url].get('sha256'))[:16]}... of the first "
            f"download, nothing was kept; if the new file is right, delete its entry in {record}"
        )
