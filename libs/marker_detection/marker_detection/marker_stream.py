"""One camera stream as the detector sees it: images in; detections, poses and new ids out."""

from __future__ import annotations

import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from marker_detection.camera_model import Array, CameraModel
from marker_detection.detector import Detection, DetectorSettings, MarkerDetector
from marker_detection.dictionaries import MarkerCodes, dictionary_named
from marker_detection.pose import MarkerPose, pose_of
from strict_files.settings import converted, parameter, parameters

# images that count, as a multiple of those that must show an id: half of them may miss it
_WINDOW = 2
# images without a marker after which other dictionaries' are looked for, and how many more each
# time: it takes as long as several images
_FIRST_LOOK, _LATER_LOOKS = 5, 10
# such markers from which a scene is taken to be another dictionary's: one may hang anywhere
_SEVERAL = 2


def sizes_from(entries: Sequence[str]) -> dict[int, float]:
    """Marker sizes by id from entries such as '14:0.3' (metres).

    Raises:
        ValueError: An entry is not an id and a positive size.
    """
    sizes = {}
    for entry in entries:
        marker_id, _, size = entry.partition(':')
        try:
            sizes[int(marker_id)] = float(size)
        except ValueError:
            raise ValueError(f"'{entry}' is not 'id:size in metres', such as '14:0.3'") from None
        if not 0.0 < sizes[int(marker_id)] < 100.0:
            raise ValueError(f"'{entry}': a size must be positive")
    return sizes


def sizes_expected(entries: Sequence[str]) -> str | None:
    """Ask for sizes of markers."""
    try:
        sizes_from(entries)
    except ValueError as error:
        return str(error)
    return None


@dataclass(frozen=True)
class StreamSettings:
    """How detections of a stream are judged.

    Attributes:
        detector: What to look for.
        known_frames: Images that must show an id of the known list before it is confirmed.

    Raises:
        ValueError: There is no such dictionary, or a known id is not in it.
    """

    detector: DetectorSettings = parameters(DetectorSettings)
    size: float = parameter(
        0.2, 'Side of the black square, metres.', 0.001, 100.0, name='marker_size'
    )
    sizes: Mapping[int, float] = converted(
        sizes_from,
        [],
        "Sizes of ids that differ, like '14:0.3'.",
        name='marker_sizes',
        of=str,
        check=sizes_expected,
    )
    known_frames: int = parameter(
        2, 'Images that confirm a known id.', 1, 100, name='confirmation_frames'
    )
    unknown_frames: int = parameter(
        4, 'Images that confirm any other id.', 1, 100, name='unknown_confirmation_frames'
    )

    def __post_init__(self) -> None:
        # Not a `check` of the parameter: every process calls those that a place's file gives, and
        # would import OpenCV.
        try:
            dictionary = dictionary_named(self.detector.dictionary)
        except ValueError as error:
            raise ValueError(f'marker_dictionary: {error}') from None
        try:
            MarkerCodes.of(dictionary, self.detector.known_ids or ())
        except ValueError as error:
            raise ValueError(f'known_ids: {error}') from None


@dataclass(frozen=True, eq=False)
class Sighting:
    """A marker in one image of the stream."""

    detection: Detection
    pose: MarkerPose | None
    size: float
    confirmed: bool


@dataclass
class Statistics:
    """What the stream was like since the last look at it."""

    images: int = 0
    seconds: float = 0.0
    refused: int = 0
    left_out: int = 0

    @property
    def mean_milliseconds(self) -> float:
        """Time for an image; 0 without any."""
        return 1e3 * self.seconds / self.images if self.images else 0.0

    def is_silent(self, in_motion: int) -> bool:
        """Tell whether no image came at all.

        Args:
            in_motion: Images that were left out because the arm moved.
        """
        return not (self.images or self.refused or in_motion)


class Confirmation:
    """Counts in how many of the last images each id was seen.

    Args:
        known_frames: Images that must show an id of the known list.
        unknown_frames: Images that must show any other id.
        confirmed: Ids that are believed from the start.
    """

    def __init__(
        self,
        known_frames: int,
        unknown_frames: int,
        confirmed: Iterable[int] = (),
    ) -> None:
        self._needed = {True: known_frames, False: unknown_frames}
        self._frame = 0
        self._seen: defaultdict[int, deque[int]] = defaultdict(deque)
        self._confirmed: set[int] = set(confirmed)

    @property
    def confirmed(self) -> frozenset[int]:
        """All ids confirmed so far."""
        return frozenset(self._confirmed)

    def image(self, ids: Iterable[tuple[int, bool]]) -> list[int]:
        """Take note of one image.

        Args:
            ids: Each id in the image and whether it is known.

        Returns:
            The ids confirmed by this image, for the first time.
        """
        self._frame += 1
        new = []
        for marker_id, known in dict(ids).items():
            needed = self._needed[known]
            frames = self._seen[marker_id]
            frames.append(self._frame)
            while frames[0] <= self._frame - _WINDOW * needed:
                frames.popleft()
            if len(frames) >= needed and marker_id not in self._confirmed:
                self._confirmed.add(marker_id)
                new.append(marker_id)
        return new


class MarkerStream:
    """Detects in image after image; what was seen in one is expected in the next.

    Attributes:
        other_family: What the markers look like that are seen instead of the dictionary's; None
            while there are some of the dictionary, or none at all.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self.statistics = Statistics()
        self._confirmation = Confirmation(settings.known_frames, settings.unknown_frames)
        self._expected: list[Array] = []
        self._settings = settings
        self._detector = MarkerDetector(settings.detector)
        self._forget_others()

    def _forget_others(self) -> None:
        self.other_family: str | None = None
        self._empty, self._next_look, self._others = 0, _FIRST_LOOK, Counter[str]()

    @property
    def confirmed(self) -> frozenset[int]:
        """All ids confirmed so far."""
        return self._confirmation.confirmed

    @property
    def left_out(self) -> int:
        """Candidates of the last image that were left unread, to bound the work."""
        return self._detector.left_out

    def adopt(self, settings: StreamSettings) -> None:
        """Go on with other settings; confirmed ids stay so, unless the dictionary changes.

        Raises:
            ValueError: The settings do not fit each other.
        """
        detector = MarkerDetector(settings.detector)
        before = frozenset[int]()
        if settings.detector.dictionary == self._settings.detector.dictionary:
            before = self._confirmation.confirmed
        self._confirmation = Confirmation(
            settings.known_frames, settings.unknown_frames, confirmed=before
        )
        self._settings, self._detector = settings, detector
        self._forget_others()

    def look(
        self, image: npt.NDArray[np.uint8], camera: CameraModel | None
    ) -> tuple[list[Sighting], list[int]]:
        """Detect in the next image.

        Args:
            image: (height, width) grey levels or (height, width, 3) BGR.
            camera: Where the image comes from; None when it is not known: ids without poses.

        Returns:
            What it shows, and the ids that it confirms for the first time.

        Raises:
            ValueError: The image is not as a detector takes it.
        """
        start = time.perf_counter()
        detections = self._detector.detect(image, self._expected)
        self._expected = [np.array(detection.corners) for detection in detections]
        self._look_for_others(image, bool(detections))
        new = self._confirmation.image((each.marker_id, each.known) for each in detections)
        confirmed = self._confirmation.confirmed
        sightings = []
        for detection in detections:
            size = self._settings.sizes.get(detection.marker_id, self._settings.size)
            pose = None if camera is None else pose_of(detection.corners, size, camera)
            sightings.append(Sighting(detection, pose, size, detection.marker_id in confirmed))
        self.statistics.images += 1
        self.statistics.left_out += self.left_out
        self.statistics.seconds += time.perf_counter() - start
        return sightings, new

    def _look_for_others(self, image: npt.NDArray[np.uint8], found: bool) -> None:
        if found:
            self._forget_others()
            return
        self._empty += 1
        if self._empty < self._next_look or self.other_family is not None:
            return
        self._next_look *= _LATER_LOOKS
        seen = self._detector.other_families(image)
        self._others.update({name: len(ids) for name, ids in seen.items()})
        if self._others and max(self._others.values()) >= _SEVERAL:
            self.other_family = self._others.most_common(1)[0][0]

    def refuse(self) -> None:
        """Count an image that could not be used."""
        self.statistics.refused += 1

    def take_statistics(self) -> Statistics:
        """Return the statistics since the last call, which begin anew."""
        taken, self.statistics = self.statistics, Statistics()
        return taken
