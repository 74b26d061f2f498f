// SPDX-License-Identifier: Apache-2.0

// Which way the patient lies in the frame `mannequin`, from where its organs are.
#pragma once

#include <limits>

#include "formats/base/geometry.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase {

struct BodyAxes {
    bool known = false;                                     // false: the labels do not say
    Vector3 right{1, 0, 0}, front{0, 1, 0}, head{0, 0, 1};  // the patient's; unit, at right angles
    // The top of the femoral heads, as a distance along `head` from the origin. Iliac vessels below
    // it are the common femoral ones: the inguinal ligament crosses them some 15 mm above the
    // femoral head's centre (N. M. Rupp et al., Cathet Cardiovasc Diagn 28:292, 1993).
    double groin_mm = -std::numeric_limits<double>::infinity();  // -infinity: no femur is labelled
};

// The head lies where lungs and upper organs are, seen from the pelvis; by vertebrae where two are
// named. Right and left are those of paired organs, or of liver and spleen. Good to some ten
// degrees. Cost: one look-up per 8 mm sample.
BodyAxes body_axes(const CaseBundle& bundle);

// The label of an iliac vessel that is femoral at this place, "common_femoral_vein_right"; every
// other label as it is.
std::string label_at(const BodyAxes& axes, const std::string& label, Point3 rest);

}  // namespace sonocase
