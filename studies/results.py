"""The results of studies, one JSON file each in `studies/results`."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from dynresp.support.errors import DynrespError
from dynresp.support.files import replacing
from studies.study import Columns

FOLDER = Path(__file__).parent / "results"
"""Where the results lie that the documents are made from."""


@dataclass(frozen=True)
class StudyResult:
    """What a study has measured.

    Attributes:
        study: Its name; also the name of the file.
        command: The command that measured it.
        date: When, as YYYY-MM-DD.
        machine: Processor, cores, system and versions.
        quick: Whether it was a quick run, whose values mean nothing.
        columns: The values.
    """

    study: str
    command: str
    date: str
    machine: str
    quick: bool
    columns: Columns

    def write(self, path: Path) -> None:
        """Write it as JSON.

        Raises:
            DynrespError: The file cannot be written.
        """
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(asdict(self), indent=2, allow_nan=False) + "\n")

    @classmethod
    def read(cls, path: Path) -> StudyResult:
        """Read what `write` has written.

        Raises:
            DynrespError: The file cannot be read or is no result of a study.
        """
        try:
            return cls(**json.loads(path.read_text()))
        except (OSError, ValueError, TypeError) as error:
            raise DynrespError(
                f"{path} is no result of a study ({error}); write it with "
                "`python -m studies NAME --json FILE`"
            ) from error


def all_results(folder: Path = FOLDER) -> dict[str, StudyResult]:
    """All results in a folder, by the name of the study.

    Raises:
        DynrespError: A file cannot be read.
    """
    results = (StudyResult.read(path) for path in sorted(folder.glob("*.json")))
    return {result.study: result for result in results}
