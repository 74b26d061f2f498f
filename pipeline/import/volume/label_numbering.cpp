// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/label_numbering.h"

#include <algorithm>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/text.h"

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

// Volumes beyond these no patient has, ml: the largest known with a good margin.
struct Limit {
    std::string_view name;  // or how the name begins
    double size;
};
constexpr Limit kLargest[] = {
    {"spleen", 5000},
    {"kidney_cyst", 3000},
    {"kidney", 1500},
    {"gallbladder", 800},
    {"liver", 6000},
    {"stomach", 4000},
    {"pancreas", 400},
    {"adrenal_gland", 60},
    {"lung", 6000},
    {"esophagus", 250},
    {"trachea", 200},
    {"thyroid", 300},
    {"duodenum", 500},
    {"urinary_bladder", 3000},
    {"prostate", 500},
    {"sacrum", 700},
    {"vertebrae_", 200},
    {"heart_", 800},
    {"heart", 2500},
    {"aorta", 1200},
    {"pulmonary", 400},
    {"brachiocephalic", 100},
    {"subclavian", 100},
    {"common_carotid", 60},
    {"superior_vena", 150},
    {"inferior_vena", 500},
    {"portal_vein", 250},
    {"iliac_artery", 250},
    {"iliac_vena", 250},
    {"spinal_cord", 250},
    {"rib_", 120},
    {"clavicula", 120},
    {"atrial_appendage", 100},
};

// Longest sides that no patient's structure has, mm.
constexpr Limit kLongest[] = {{"vertebrae_", 160},  {"kidney", 230},    {"adrenal_gland", 110},
                              {"gallbladder", 220}, {"pancreas", 280},  {"duodenum", 300},
                              {"prostate", 130},    {"heart", 280},     {"thyroid", 160},
                              {"sacrum", 230},      {"liver", 450},     {"spleen", 400},
                              {"portal_vein", 280}, {"clavicula", 230}, {"brachiocephalic", 160}};

// What takes up most of a body: less than this is another structure, ml.
constexpr Limit kSmallest[] = {
    {"body_trunc", 1000}, {"subcutaneous_fat", 200}, {"torso_fat", 50}, {"skeletal_muscle", 200}};

// `first` lies farther along the axis than `second`: to the right, to the front, to the head.
struct Order {
    std::string_view first, second;
    int axis;
};
constexpr Order kOrders[] = {
    {"liver", "spleen", 0},
    {"liver", "stomach", 0},
    {"liver", "kidney_left", 0},
    {"aorta", "stomach", 0},
    {"pancreas", "spleen", 0},
    {"duodenum", "spleen", 0},
    {"kidney_right", "iliac_artery_left", 2},
    {"kidney_right", "iliac_artery_right", 2},
    {"kidney_left", "iliac_vena_left", 2},
    {"kidney_right", "iliac_vena_right", 2},
    {"liver", "iliac_artery_left", 2},
    {"liver", "iliac_artery_right", 2},
    {"liver", "vertebrae_L4", 2},
    {"liver", "vertebrae_L5", 2},
    {"liver", "aorta", 0},
    {"kidney_right", "kidney_left", 0},
    {"kidney_right", "spleen", 0},
    {"gallbladder", "spleen", 0},
    {"inferior_vena_cava", "aorta", 0},
    {"adrenal_gland_right", "adrenal_gland_left", 0},
    {"lung_right", "lung_left", 0},
    {"lung_upper_lobe_right", "lung_upper_lobe_left", 0},
    {"lung_lower_lobe_right", "lung_lower_lobe_left", 0},
    {"liver", "urinary_bladder", 2},
    {"spleen", "urinary_bladder", 2},
    {"kidney_right", "urinary_bladder", 2},
    {"kidney_left", "urinary_bladder", 2},
    {"aorta", "urinary_bladder", 2},
    {"liver", "prostate", 2},
    {"spleen", "prostate", 2},
    {"kidney_right", "prostate", 2},
    {"kidney_left", "prostate", 2},
    {"liver", "sacrum", 2},
    {"spleen", "sacrum", 2},
    {"heart", "kidney_right", 2},
    {"heart", "kidney_left", 2},
    {"heart", "urinary_bladder", 2},
    {"trachea", "liver", 2},
    {"trachea", "kidney_left", 2},
    {"thyroid_gland", "liver", 2},
    {"brain", "liver", 2},
    {"esophagus", "kidney_right", 2},
    {"esophagus", "kidney_left", 2},
    {"esophagus", "urinary_bladder", 2},
    {"lung_left", "kidney_left", 2},
    {"lung_right", "kidney_right", 2},
    {"lung_upper_lobe_left", "kidney_left", 2},
    {"lung_upper_lobe_right", "kidney_right", 2},
    {"lung_middle_lobe_right", "kidney_right", 2},
    {"lung_lower_lobe_left", "kidney_left", 2},
    {"lung_lower_lobe_right", "kidney_right", 2},
    {"adrenal_gland_right", "urinary_bladder", 2},
    {"adrenal_gland_left", "urinary_bladder", 2},
    {"vertebrae_T12", "vertebrae_L1", 2},
    {"vertebrae_T11", "vertebrae_T12", 2},
    {"vertebrae_L1", "vertebrae_L2", 2},
    {"vertebrae_L2", "vertebrae_L3", 2},
    {"vertebrae_L3", "vertebrae_L4", 2},
    {"vertebrae_L4", "vertebrae_L5", 2},
    {"vertebrae_L5", "sacrum", 2},
    {"liver", "vertebrae_L1", 1},
    {"stomach", "vertebrae_L1", 1},
    {"aorta", "vertebrae_L1", 1},
    {"pancreas", "vertebrae_L1", 1},
    {"liver", "autochthon_left", 1},
    {"liver", "autochthon_right", 1},
    {"urinary_bladder", "sacrum", 1},
};
constexpr double kOrderMargin_mm = 10;  // organs of one height may lie in either order

const Limit* row_of(std::span<const Limit> rows, std::string_view name) {
    for (const Limit& row : rows)
        if (name.starts_with(row.name)) return &row;
    return nullptr;
}

std::string with_name(int value, std::string_view name) {
    return std::to_string(value) + " would be " + std::string(name);
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

NamesFit names_fit(const Numbering& numbering, std::span<const NumberedStructure> structures) {
    NamesFit fit;
    for (const NumberedStructure& s : structures) {
        const std::string_view name = numbering.name(s.value);
        if (name.empty()) continue;
        const Limit* largest = row_of(kLargest, name);
        const Limit* longest = row_of(kLongest, name);
        const Limit* smallest = row_of(kSmallest, name);
        if (longest != nullptr && s.length_mm > longest->size) {
            fit.misfits.push_back(with_name(s.value, name) + text(" %.0f mm long", s.length_mm));
        }
        if ((largest == nullptr || s.volume_ml <= largest->size) &&
            (smallest == nullptr || s.volume_ml >= smallest->size))
            continue;
        fit.gross = true;
        fit.misfits.insert(fit.misfits.begin(),
                           with_name(s.value, name) + text(" of %.0f ml", s.volume_ml));
    }
    const auto find = [&](std::string_view name) -> const NumberedStructure* {
        for (const NumberedStructure& s : structures)
            if (numbering.name(s.value) == name) return &s;
        return nullptr;
    };
    const char* beyond[3] = {"to the right of", "in front of", "above"};
    for (const Order& order : kOrders) {
        const NumberedStructure *first = find(order.first), *second = find(order.second);
        if (first == nullptr || second == nullptr) continue;
        const double ahead = first->centre_mm[order.axis] - second->centre_mm[order.axis];
        if (ahead > kOrderMargin_mm) ++fit.passed;
        if (ahead >= -kOrderMargin_mm) continue;
        fit.misfits.push_back(with_name(second->value, order.second) + " " + beyond[order.axis] +
                              " " + std::to_string(first->value) + ", " + std::string(order.first));
    }
    // Vertebrae of the chest and neck lie above the kidneys, the upper ones above the liver.
    for (const NumberedStructure& s : structures) {
        const std::string_view name = numbering.name(s.value);
        const bool neck = name.starts_with("vertebrae_C");
        const bool chest = name.size() == 12 && name.starts_with("vertebrae_T");
        if (!neck && !chest) continue;
        for (const char* below : {"liver", "kidney_right", "kidney_left", "urinary_bladder"}) {
            const NumberedStructure* organ = find(below);
            if (organ == nullptr || (chest && name[11] > '7' && below[0] == 'l')) continue;
            if (s.centre_mm.z < organ->centre_mm.z - kOrderMargin_mm) {
                fit.misfits.push_back(with_name(s.value, name) + " below " +
                                      std::to_string(organ->value) + ", " + below);
                break;
            }
        }
    }
    // What is called left lies to the left of the liver, and what is called right not beyond the
    // spleen.
    const NumberedStructure *liver = find("liver"), *spleen = find("spleen");
    for (const NumberedStructure& s : structures) {
        const std::string_view name = numbering.name(s.value);
        if (liver != nullptr && name.find("_left") != std::string_view::npos) {
            if (s.centre_mm.x > liver->centre_mm.x + kOrderMargin_mm)
                fit.misfits.push_back(with_name(s.value, name) + " to the right of " +
                                      std::to_string(liver->value) + ", liver");
        }
        if (spleen != nullptr && name.find("_right") != std::string_view::npos) {
            if (s.centre_mm.x < spleen->centre_mm.x - kOrderMargin_mm)
                fit.misfits.push_back(with_name(s.value, name) + " to the left of " +
                                      std::to_string(spleen->value) + ", spleen");
        }
    }
    return fit;
}

std::vector<const Numbering*> other_numberings(const Numbering& than,
                                               std::span<const NumberedStructure> structures) {
    std::vector<std::pair<int, const Numbering*>> fitting;
    for (const Numbering& numbering : numberings()) {
        const bool names_all =
            std::all_of(structures.begin(), structures.end(),
                        [&](const auto& s) { return !numbering.name(s.value).empty(); });
        const bool same = std::all_of(structures.begin(), structures.end(), [&](const auto& s) {
            return numbering.name(s.value) == than.name(s.value);
        });
        if (!names_all || same) continue;
        const NamesFit fit = names_fit(numbering, structures);
        if (fit.misfits.empty()) fitting.emplace_back(fit.passed, &numbering);
    }
    std::stable_sort(fitting.begin(), fitting.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<const Numbering*> others;
    for (const auto& [passed, numbering] : fitting) others.push_back(numbering);
    return others;
}

}  // namespace sonocase::pipeline::inline import_volume
