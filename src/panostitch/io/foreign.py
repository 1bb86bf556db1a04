"""Photos as cameras and phones write them that are not read: what they are, and what to do with them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from panostitch.errors import InputError

# What cameras call them; a file of another name may still be known by its tags.
NAMES = "3fr arw cr2 cr3 crw dng erf fff iiq kdc mos mrw nef nrw orf pef raf raw rw2 rwl sr2 srf srw x3f"
RAW = frozenset(f".{name}" for name in NAMES.split())
HEIF = frozenset((".heic", ".heif", ".hif", ".avif"))
BRANDS = frozenset((b"heic", b"heix", b"heim", b"heis", b"hevc", b"mif1", b"msf1", b"avif", b"avis"))
DEVELOP = "develop all of them alike, to JPEG or to TIFF of 16 bits"
EXPORT = "save them as JPEG; an iPhone takes JPEG with Settings > Camera > Formats > Most Compatible"
SUBFILE_TYPE, SUB_DIRECTORIES, DNG_VERSION = 254, 330, 50706  # tags of TIFF
REDUCED = 1  # of the type: a smaller copy of another picture in the file


def remedy(extension: str) -> str:
    """What to do with files of an extension (.nef, .heic); empty for what is not known here."""
    return DEVELOP if extension.lower() in RAW else EXPORT if extension.lower() in HEIF else ""


def check_name(path: str) -> None:
    """Raise InputError where a name is that of a raw photo: such a file often opens, as its small preview."""
    if Path(path).suffix.lower() in RAW:
        raise _raw(path)


def check_tags(path: str, tags: Mapping[int, Any]) -> None:
    """Raise InputError where the tags of a TIFF are those of a raw photo, whose first picture is a preview."""
    if DNG_VERSION in tags or (SUB_DIRECTORIES in tags and tags.get(SUBFILE_TYPE, 0) & REDUCED):
        raise _raw(path)


def known_but_unread(path: str) -> InputError | None:
    """What to say of a file that no reader knows: HEIC and AVIF, by any name; None for anything else."""
    try:
        with open(path, "rb") as file:
            head = file.read(12)
    except OSError:
        return None
    if head[4:8] != b"ftyp" or head[8:] not in BRANDS:
        return None
    return InputError(f"{path}: HEIC or AVIF, which is not read", hint=EXPORT)


def _raw(path: str) -> InputError:
    return InputError(f"{path}: a raw photo, of which only a small preview could be read", hint=DEVELOP)
