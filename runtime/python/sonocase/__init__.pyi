# SPDX-License-Identifier: Apache-2.0
import os
from typing import Any, Iterable, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import data as data
from . import domain as domain
from . import environment as environment
from . import pose as Pose

__version__: str

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]
# Rigid motions, 4 x 4, mm. A needle: mannequin_from_needle (z from hub to tip, x to the side that
# its bevel faces), or (tip, direction), where the bevel faces the probe.
PoseArray = npt.ArrayLike
NeedleArray = Union[npt.ArrayLike, tuple[npt.ArrayLike, npt.ArrayLike], None]

class Error(Exception): ...

# What stands for NumPy's arrays below where NumPy cannot be imported.
class Array:
    shape: tuple[int, ...]
    dtype: str
    nbytes: int
    def __init__(self, shape: Sequence[int], dtype: str = ...) -> None: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Union[int, tuple[int, ...]]) -> Any: ...
    def tolist(self) -> Any: ...
    @property
    def __array_interface__(self) -> dict[str, Any]: ...
    def __dlpack__(self, *, stream: None = ..., max_version: Optional[tuple[int, int]] = ...,
                   dl_device: Optional[tuple[int, int]] = ..., copy: Optional[bool] = ...) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...

class Label:
    name: str
    tissue: str
    colour: tuple[int, int, int]

class Probe:
    shape: str
    radius_mm: float
    field_of_view_rad: float
    width_mm: float
    depth_mm: float
    frequency_mhz: float
    focus_mm: float
    elevation_mm: float
    def __init__(self, *, shape: str = ..., radius_mm: float = ..., field_of_view_rad: float = ...,
                 width_mm: float = ..., depth_mm: float = ..., frequency_mhz: float = ...,
                 focus_mm: float = ..., elevation_mm: float = ...) -> None: ...

class Needle:
    make: str
    gauge: float
    diameter_mm: float
    length_mm: float
    def __init__(self, *, make: str = ..., gauge: float = ..., diameter_mm: float = ...,
                 length_mm: float = ...) -> None: ...

class Target:
    name: str
    centre_mm: npt.NDArray[np.float64]
    radius_mm: float
    hit_radius_mm: float
    inside: str

class Exercise:
    name: str
    title: str
    description: str
    kind: str
    difficulty: int
    model: str
    effects: list[str]
    probe: Probe
    needle: Needle
    targets: list[Target]
    no_go: list[str]
    start_pose: npt.NDArray[np.float64]
    breathing: Mapping[str, float]
    sweeps: list[str]
    def sweep_poses(self, name: str) -> list[npt.NDArray[np.float64]]: ...

class Case:
    path: str
    name: str
    closed: bool
    warnings: list[str]
    labels: list[Label]
    exercises: list[Exercise]
    size: tuple[int, int, int]
    voxel_mm: float
    origin_mm: npt.NDArray[np.float64]
    @staticmethod
    def open(path: Path) -> Case: ...
    def close(self) -> None: ...
    def __enter__(self) -> Case: ...
    def __exit__(self, *args: Any) -> None: ...
    def exercise(self, name: str = ...) -> Exercise: ...
    def label_volume(self) -> npt.NDArray[np.uint8]: ...
    def labels_at(self, points: npt.ArrayLike) -> list[int]: ...
    def skin_point(self, near: npt.ArrayLike, direction: npt.ArrayLike,
                   reach_mm: float = ...) -> Optional[npt.NDArray[np.float64]]: ...
    def skin_normal(self, point: npt.ArrayLike,
                    radius_mm: float = ...) -> Optional[npt.NDArray[np.float64]]: ...

class TruthPlanes:
    labels: Optional[npt.NDArray[np.uint8]]
    needle: Optional[npt.NDArray[np.uint8]]
    shadowed: Optional[npt.NDArray[np.uint8]]
    skin_depth_mm: Optional[npt.NDArray[np.float32]]
    lesions: Optional[npt.NDArray[np.uint8]]
    rest_mm: Optional[npt.NDArray[np.float32]]

class Renderer:
    size: tuple[int, int]
    closed: bool
    contact: bool
    press: dict[str, Any]
    skipped_effects: dict[str, str]
    exercise: Exercise
    mm_per_px: float
    origin_px: tuple[float, float]
    def __init__(self, case: Case, exercise: Union[str, Exercise, None] = ...,
                 probe: Optional[Probe] = ..., needle: Optional[Needle] = ..., *, model: str = ...,
                 machine: Path = ..., effects: Union[str, Sequence[str], None] = ...,
                 size: tuple[int, int] = ..., seed: int = ..., renderer: str = ...,
                 scanlines: int = ..., samples: int = ..., looks: int = ...) -> None: ...
    def close(self) -> None: ...
    def __enter__(self) -> Renderer: ...
    def __exit__(self, *args: Any) -> None: ...
    def render(self, pose: PoseArray, needle: NeedleArray = ..., time_s: float = ..., *,
               frame: int = ..., gain_db: float = ..., dynamic_range_db: float = ...,
               press_mm: float = ...,
               dent: Optional[npt.ArrayLike] = ...,
               out: Any = ..., mode: str = ...,
               doppler: dict[str, Any] = ...) -> npt.NDArray[np.uint8]: ...
    def aimed(self, pose: PoseArray) -> dict[str, float]: ...
    @property
    def doppler(self) -> dict[str, Any]: ...
    # With truth: (pictures, TruthPlanes, list of facts).
    def render_batch(self, poses: npt.ArrayLike, needles: Optional[Sequence[NeedleArray]] = ...,
                     times_s: Optional[npt.ArrayLike] = ..., *, first_frame: int = ...,
                     gain_db: float = ..., dynamic_range_db: float = ...,
                     press_mm: npt.ArrayLike = ...,
                     dents: Optional[Sequence[Optional[npt.ArrayLike]]] = ...,
                     out: Any = ...,
                     threads: int = ..., truth: Optional[Sequence[str]] = ...) -> Any: ...
    def truth(self, planes: Iterable[str] = ...) -> tuple[TruthPlanes, dict[str, Any]]: ...

def read_session(path: Path) -> dict[str, Any]: ...
def score(case: Case, session: Path, exercise: Optional[Exercise] = ...) -> dict[str, Any]: ...
def simd_targets() -> list[str]: ...
