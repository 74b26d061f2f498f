// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/label_numbering.h"

#include <algorithm>

#include "pipeline/anatomy/tissue_table.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

using Names = std::vector<std::string_view>;

void add_vertebrae(Names& names) {
    names.insert(names.end(),
                 {"vertebrae_L5",  "vertebrae_L4",  "vertebrae_L3",  "vertebrae_L2", "vertebrae_L1",
                  "vertebrae_T12", "vertebrae_T11", "vertebrae_T10", "vertebrae_T9", "vertebrae_T8",
                  "vertebrae_T7",  "vertebrae_T6",  "vertebrae_T5",  "vertebrae_T4", "vertebrae_T3",
                  "vertebrae_T2",  "vertebrae_T1",  "vertebrae_C7",  "vertebrae_C6", "vertebrae_C5",
                  "vertebrae_C4",  "vertebrae_C3",  "vertebrae_C2",  "vertebrae_C1"});
}

// The limb bones and the muscles of the pelvis, in the order of TotalSegmentator.
void add_limbs(Names& names) {
    names.insert(names.end(), {"humerus_left", "humerus_right", "scapula_left", "scapula_right",
                               "clavicula_left", "clavicula_right", "femur_left", "femur_right",
                               "hip_left", "hip_right"});
}
void add_muscles(Names& names) {
    names.insert(names.end(),
                 {"gluteus_maximus_left", "gluteus_maximus_right", "gluteus_medius_left",
                  "gluteus_medius_right", "gluteus_minimus_left", "gluteus_minimus_right",
                  "autochthon_left", "autochthon_right", "iliopsoas_left", "iliopsoas_right"});
}

Names total_v1() {
    Names names{"spleen",
                "kidney_right",
                "kidney_left",
                "gallbladder",
                "liver",
                "stomach",
                "aorta",
                "inferior_vena_cava",
                "portal_vein_and_splenic_vein",
                "pancreas",
                "adrenal_gland_right",
                "adrenal_gland_left",
                "lung_upper_lobe_left",
                "lung_lower_lobe_left",
                "lung_upper_lobe_right",
                "lung_middle_lobe_right",
                "lung_lower_lobe_right"};
    add_vertebrae(names);
    names.insert(names.end(),
                 {"esophagus", "trachea", "heart_myocardium", "heart_atrium_left",
                  "heart_ventricle_left", "heart_atrium_right", "heart_ventricle_right",
                  "pulmonary_artery", "brain", "iliac_artery_left", "iliac_artery_right",
                  "iliac_vena_left", "iliac_vena_right", "small_bowel", "duodenum", "colon"});
    // The ribs stand side by side in the second version as well.
    const auto total = total_segmentator_labels();
    const auto rib = std::find(total.begin(), total.end(), "rib_left_1");
    names.insert(names.end(), rib, rib + 24);
    add_limbs(names);
    names.insert(names.end(), {"sacrum", "face"});
    add_muscles(names);
    names.push_back("urinary_bladder");
    return names;
}

Names total_mr() {
    Names names{"spleen",
                "kidney_right",
                "kidney_left",
                "gallbladder",
                "liver",
                "stomach",
                "pancreas",
                "adrenal_gland_right",
                "adrenal_gland_left",
                "lung_left",
                "lung_right",
                "esophagus",
                "small_bowel",
                "duodenum",
                "colon",
                "urinary_bladder",
                "prostate",
                "sacrum",
                "vertebrae",
                "intervertebral_discs",
                "spinal_cord",
                "heart",
                "aorta",
                "inferior_vena_cava",
                "portal_vein_and_splenic_vein",
                "iliac_artery_left",
                "iliac_artery_right",
                "iliac_vena_left",
                "iliac_vena_right"};
    add_limbs(names);
    add_muscles(names);
    names.push_back("brain");
    return names;
}

std::vector<Numbering> all_numberings() {
    const auto total = total_segmentator_labels();
    std::vector<Numbering> all{
        {"total", "TotalSegmentator v2 total", Names(total.begin(), total.end())},
        {"total_v1", "TotalSegmentator v1 total", total_v1()},
        {"total_mr", "TotalSegmentator total_mr", total_mr()},
        {"body", "TotalSegmentator body", {"body_trunc", "body_extremities"}},
        {"tissue_types",
         "TotalSegmentator tissue_types",
         {"subcutaneous_fat", "torso_fat", "skeletal_muscle"}},
        {"tissue_4_types",
         "TotalSegmentator tissue_4_types",
         {"subcutaneous_fat", "torso_fat", "skeletal_muscle", "intermuscular_fat"}},
        {"amos",
         "AMOS",
         {"spleen", "kidney_right", "kidney_left", "gallbladder", "esophagus", "liver", "stomach",
          "aorta", "inferior_vena_cava", "pancreas", "adrenal_gland_right", "adrenal_gland_left",
          "duodenum", "urinary_bladder", "prostate"}},
        {"btcv",
         "BTCV",
         {"spleen", "kidney_right", "kidney_left", "gallbladder", "esophagus", "liver", "stomach",
          "aorta", "inferior_vena_cava", "portal_vein_and_splenic_vein", "pancreas",
          "adrenal_gland_right", "adrenal_gland_left"}},
        {"flare22",
         "FLARE22",
         {"liver", "kidney_right", "spleen", "pancreas", "aorta", "inferior_vena_cava",
          "adrenal_gland_right", "adrenal_gland_left", "gallbladder", "esophagus", "stomach",
          "duodenum", "kidney_left"}},
    };
    return all;
}

}  // namespace

std::string_view Numbering::name(int value) const {
    if (value < 1 || static_cast<std::size_t>(value) > names.size()) return {};
    return names[static_cast<std::size_t>(value) - 1];
}

const std::vector<Numbering>& numberings() {
    static const std::vector<Numbering> all = all_numberings();
    return all;
}

const Numbering* find_numbering(std::string_view key) {
    for (const Numbering& numbering : numberings())
        if (numbering.key == key) return &numbering;
    return nullptr;
}

BodySummary named_by(const Numbering& numbering, const BodySummary& body) {
    BodySummary named = body;
    for (LabelSummary& label : named.labels) label.name = numbering.name(label.value);
    return named;
}

std::vector<const Numbering*> other_numberings(const Numbering& than, const BodySummary& body) {
    std::vector<std::pair<double, const Numbering*>> fitting;
    for (const Numbering& numbering : numberings()) {
        const auto& labels = body.labels;
        const bool names_all = std::all_of(labels.begin(), labels.end(), [&](const auto& label) {
            return !numbering.name(label.value).empty();
        });
        const bool same = std::all_of(labels.begin(), labels.end(), [&](const auto& label) {
            return numbering.name(label.value) == than.name(label.value);
        });
        if (!names_all || same) continue;
        const NamesFit fit = names_fit(named_by(numbering, body));
        if (fit.misfits.empty()) fitting.emplace_back(fit.agreement.value_or(0), &numbering);
    }
    std::stable_sort(fitting.begin(), fitting.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<const Numbering*> others;
    for (const auto& [agreement, numbering] : fitting) others.push_back(numbering);
    return others;
}

}  // namespace sonocase::pipeline::inline import_volume
