// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_plane.h"

#include <cassert>

namespace sonocase::runtime::press {

PressFace press_face(const Probe& probe) {
    switch (probe.shape) {
        case ProbeShape::linear: return {0.5 * probe.width_mm, 4, 0};
        case ProbeShape::curvilinear:
            return {0.5 * probe.radius_mm * probe.field_of_view_rad, 6.5, probe.radius_mm};
        case ProbeShape::phased: return {0.5 * probe.width_mm, 5, 0};
    }
    assert(false);
    return {};
}

}  // namespace sonocase::runtime::press
