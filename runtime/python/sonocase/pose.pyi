# SPDX-License-Identifier: Apache-2.0
from typing import Optional

import numpy as np
import numpy.typing as npt

from . import Case

# Rigid motions, 4 x 4, mm; docstrings say which.
def looking(point: npt.ArrayLike, beam: npt.ArrayLike,
            lateral: npt.ArrayLike = ...) -> npt.NDArray[np.float64]: ...
def on_skin(case: Case, near: npt.ArrayLike, beam: Optional[npt.ArrayLike] = ...,
            lateral: npt.ArrayLike = ..., pressed_mm: float = ...) -> Optional[npt.NDArray[np.float64]]: ...
def turned(pose: npt.ArrayLike, tilt_rad: float = ..., rock_rad: float = ...,
           rotate_rad: float = ...) -> npt.NDArray[np.float64]: ...
def moved(pose: npt.ArrayLike, offset_mm: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
def inverse(pose: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
