// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_press.h"

#include "runtime/imaging/physical/model/pressed_surface.h"

namespace sonocase::runtime {

void press_place(const ReferenceInput& in, int k, int l, Vector3 beam, Place& place) {
    const ScanGeometry& g = in.geometry;
    const PhysicalFrame& f = in.frame;
    const ScanGeometry::Beam& of = g.beams[static_cast<std::size_t>(l)];
    const PlanePoint d = of.direction;
    const double r = in.row(k).r_mm;
    const press::PlaneShift here = press::plane_shift(*f.press, g, of, l, r);
    const press::PlaneShift above =
        k > 0 ? press::plane_shift(*f.press, g, of, l, in.row(k - 1).r_mm) : here;
    const PlanePoint n = press::beside(d);
    if (place.second >= 0)
        physical::press_surface(beam, f.volume_from_probe.rotation * Vector3{n.x, 0, n.z},
                                1 + (here.along_mm - above.along_mm) / g.step_mm, here.tilt,
                                place.normal, place.distance_mm);
    const double lateral =
        press::follows_columns(g) ? press::lateral_of_line(g, l) : of.origin.x + r * d.x;
    const double depth = press::follows_columns(g) ? r : of.origin.z + r * d.z;
    if (f.press->closed_in_plane({lateral, depth}))
        place.label = in.scene.closed_label[static_cast<std::size_t>(place.label)];
}

}  // namespace sonocase::runtime
