"""The observer's parameters, and what stands in the files that they name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from indoor_watch import (
    DEFAULT_RULES,
    EvidenceStore,
    WatchRule,
    read_watch_file,
    with_baseline,
)
from indoor_watch.onnx_network import RUNTIMES
from indoor_watch.persons import Person, load_finder
from indoor_watch.reference_views import ReferenceViews
from lidar_navigation.robot_base import robot_radius
from strict_files.files import FileError
from strict_files.settings import parameter
from surveillance_ontology.patrol_vocabulary import LONGEST_THRESHOLD
from surveillance_perception.marker_registry import read_registry
from surveillance_runtime.parameters import ParameterError


@dataclass(frozen=True)
class ObserverSettings:
    """What is watched and what is kept."""

    watch_file: str = parameter(
        '', 'The rules of what matters, watch.yaml; empty: changes are noted, nobody is called.'
    )
    state_file: str = parameter(
        '', 'File that keeps events and what is normal over a restart; empty: nothing is kept.'
    )
    record: str = parameter(
        '', 'The log of the run, which gets what was found and what people said; empty: none.'
    )
    evidence_folder: str = parameter(
        '', 'Folder for pictures of what was seen; empty: no picture is kept.'
    )
    evidence_megabytes: float = parameter(
        300.0, 'What all pictures may take; the least severe and oldest go first.', 1.0, 100_000.0
    )
    markers_file: str = parameter(
        '',
        'What markers stand for: any other one is unknown; empty: each that is seen is known.',
    )
    verify_seconds: float = parameter(
        20.0,
        'An alert that one look alone does not make sure waits so long for a second one, s.',
        0.0,
        3600.0,
    )
    facts: bool = parameter(True, 'Whether events become facts of the ontology.')
    alert_threshold: int = parameter(
        60,
        'While an alert is open its place is URGENT after so long without a visit, s.',
        0,
        LONGEST_THRESHOLD,
    )
    peer_timeout: float = parameter(
        10.0, 'How long map builder and ontology may take to answer, s of real time.', 0.1, 3600.0
    )
    evidence_days: float = parameter(
        30.0, 'Pictures that are older are deleted, days.', 0.01, 36_500.0
    )
    radius: float = robot_radius()
    camera: bool = parameter(True, 'Whether pictures are looked at.')
    persons: bool = parameter(
        True,
        'Whether persons are looked for in pictures, where the packages for that are installed.',
    )
    person_weights: str = parameter(
        '',
        'A network that finds persons: an ONNX file, or SSDLite as frozen_inference_graph.pb; '
        'empty: that of the package that is installed.',
    )
    person_runtime: str = parameter(
        'auto',
        'What runs an ONNX file; auto: OpenCV, or onnxruntime where OpenCV cannot read it.',
        choices=RUNTIMES,
    )

    def rules(self, places: Sequence[str], doors: Sequence[str]) -> Sequence[WatchRule]:
        """Return what matters.

        Raises:
            ParameterError: The file says something else.
        """
        if not self.watch_file:
            return with_baseline(DEFAULT_RULES)
        try:
            return with_baseline(read_watch_file(Path(self.watch_file), places, doors))
        except FileError as error:
            raise ParameterError(f'observer: {error}') from None

    def known_markers(self) -> dict[int, tuple[float, float, float] | None]:
        """Return the ids that hang here, and where, map frame, metres; None: that is learned.

        Raises:
            ParameterError: The file says something else.
        """
        if not self.markers_file:
            return {}
        try:
            known = read_registry(Path(self.markers_file))
        except FileError as error:
            raise ParameterError(f'observer: {error}') from None
        return {number: each.hangs_at for number, each in known.items()}

    def views(self) -> ReferenceViews:
        """Return how viewpoints look normally, beside the state's file."""
        file = Path(self.state_file).expanduser()
        return ReferenceViews(file.with_suffix('.views') if self.state_file else None)

    def store(self, complain: Callable[[str], object]) -> EvidenceStore | None:
        """Return where pictures are kept; None: nowhere."""
        if not self.evidence_folder:
            return None
        try:
            return EvidenceStore(
                Path(self.evidence_folder),
                round(1e6 * self.evidence_megabytes),
                self.evidence_days,
            )
        except OSError as error:
            folder = self.evidence_folder
            complain(f'evidence_folder {folder}: {error.strerror}; no picture is kept')
            return None

    def person_finder(
        self, complain: Callable[[str], object]
    ) -> Callable[[NDArray[np.uint8]], list[Person]] | None:
        """Return what finds persons in pictures; None: nothing does.

        Raises:
            ParameterError: The file of weights is something else.
        """
        if not (self.camera and self.persons):
            return None
        try:
            return load_finder(self.person_weights, self.person_runtime).find
        except ValueError as error:
            if self.person_weights:
                raise ParameterError(f'observer: {error}') from None
            complain(f'{error}; those who walk are seen by the lidar')
            return None
