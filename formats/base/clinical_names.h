// SPDX-License-Identifier: Apache-2.0

// What a clinician calls the parts that a case's labels name. Segmentations name by rule
// ("iliac_vena_right", "other_muscle_like"); the table says the words where the label's own are not
// a clinician's. Other languages translate the words (formats/words).
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace sonocase {

struct ClinicalName {
    std::string_view label;  // without side and number
    std::string_view words;  // English, as in the middle of a list: a capital at the start
};
// Sorted by label.
std::span<const ClinicalName> clinical_names();

// A label taken apart: "rib_right_7" is Rib, right, 7; "vertebrae_L3" is Vertebra, L3;
// "hepatic_vein_3mm" is Hepatic vein.
struct LabelParts {
    std::string words;   // English
    std::string side;    // "left", "right" or empty
    std::string number;  // of a rib, a vertebra, a lesion; empty: none
};
LabelParts label_parts(std::string_view label);

// In English: "Left kidney", "Right 7th rib", "L3 vertebra", "Metastasis 2".
std::string clinical_name(std::string_view label);

}  // namespace sonocase
