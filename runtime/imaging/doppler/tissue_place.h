// SPDX-License-Identifier: Apache-2.0

// What a Doppler mode asks of the picture that it is laid over: where the tissue that it shows lies
// in the bundle, and how it moves. The interface alone; runtime/imaging/doppler_view implements it
// on a renderer, tests on a still tube.
#pragma once

#include "formats/base/geometry.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime::doppler {

class TissuePlace {
  public:
    virtual ~TissuePlace() = default;

    // Where the tissue at a point of the scan plane lies at rest, frame `mannequin`.
    virtual Point3 rest(PlanePoint shown) const = 0;
    // Velocity of that tissue relative to the probe, mm/s, frame `mannequin`: breathing, and the
    // probe's own motion.
    virtual Vector3 velocity_mm_s(PlanePoint shown) const = 0;
    // True where the place at rest lies in a vein that is pressed shut.
    virtual bool shut(Point3 rest) const = 0;
    // True where any vein may be.
    virtual bool presses() const = 0;
    // True where a beam is stopped: bone or gas. They move little, so that motion is left out.
    virtual bool blocks(PlanePoint shown) const = 0;
    virtual Rigid mannequin_from_probe() const = 0;
};

}  // namespace sonocase::runtime::doppler
