// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/tissue.h"

#include <string>

namespace sonocase {
namespace {

struct Row {
    std::string_view tissue;
    TissueMechanics mechanics;  // stiffness kPa, drains, puncture N, rigid
};

constexpr TissueMechanics kVein{0.6, true, 0.4, false};      // closes as the venous pressure falls
                                                             // short, PMC11922486; scale (assumed)
constexpr TissueMechanics kArtery{60, false, 0.8, false};    // Ep 143 kPa, common femoral; half
constexpr TissueMechanics kThrombus{10, false, 0.4, false};  // (assumed)
constexpr TissueMechanics kFluid{1, false, 0.3, false};      // keeps its volume (assumed)
constexpr TissueMechanics kGland{10, false, 0.15, false};    // (assumed)
constexpr TissueMechanics kBowel{4, false, 0.05, false};     // (assumed)
constexpr TissueMechanics kRigid{kMaxStiffnessKpa, false, kMaxPunctureN, true};

constexpr Row kRows[] = {
    {"outside", {2, false, 0, false}},    // air inside the body yields as gas does (assumed)
    {"skin", {60, false, 1.0, false}},    // indentation 5 to 100 (assumed); 0.5 to 1 N, Maloney
    {"fat", {4, false, 0.05, false}},     // 26 +- 19 at 1 N, PMC9711973; small strain (assumed)
    {"muscle", {15, false, 0.1, false}},  // 62 +- 10 at 5 N, PMC9711973; relaxed (assumed)
    {"heart_muscle", {15, false, 0.1, false}},    // (assumed)
    {"liver", {6, false, 0.1, false}},            // shear modulus 1.8 +- 0.4 kPa, PMC6925591
    {"pancreas", {6, false, 0.1, false}},         // as liver (assumed)
    {"kidney_cortex", {12, false, 0.15, false}},  // (assumed)
    {"kidney_sinus", {12, false, 0.15, false}},   // (assumed)
    {"spleen", {12, false, 0.15, false}},         // (assumed)
    {"gland", kGland},
    {"lesion", kGland},
    {"brain", {3, false, 0.05, false}},    // (assumed)
    {"nerve", {30, false, 0.2, false}},    // (assumed)
    {"tendon", {200, false, 0.5, false}},  // across its fibres (assumed)
    {"fascia", {60, false, 0.5, false}},   // (assumed)
    {"bowel", kBowel},
    {"soft_tissue", {8, false, 0.1, false}},  // (assumed)
    {"soft", {8, false, 0.1, false}},         // (assumed)
    {"cartilage", {500, false, 5, false}},    // (assumed)
    {"vein", kVein},
    {"artery", kArtery},
    {"thrombus", kThrombus},
    {"urine", kFluid},
    {"bile", kFluid},
    {"cyst", kFluid},
    {"cerebrospinal_fluid", kFluid},
    {"gas", {2, false, 0.05, false}},   // (assumed)
    {"lung", {3, false, 0.05, false}},  // (assumed)
    {"bone", kRigid},
    {"metal", kRigid},
};

TissueMechanics of_vessel(Vessel vessel) {
    switch (vessel) {
        case Vessel::vein: return kVein;
        case Vessel::thrombus: return kThrombus;
        case Vessel::artery:
        case Vessel::unknown: break;
    }
    return kArtery;
}

TissueMechanics by_kind(TissueKind kind) {
    switch (kind) {
        case TissueKind::outside:
        case TissueKind::gas: return {2, false, 0.05, false};
        case TissueKind::fluid: return kFluid;
        case TissueKind::bone: return kRigid;
        case TissueKind::soft: break;
    }
    return {8, false, 0.1, false};
}

// "_inferior_vena_cava_": words between underscores, lower case.
std::string words_of(std::string_view name) {
    std::string out = "_";
    for (const char c : name) {
        const bool upper = c >= 'A' && c <= 'Z', lower = c >= 'a' && c <= 'z';
        const bool digit = c >= '0' && c <= '9';
        out += upper ? static_cast<char>(c - 'A' + 'a') : lower || digit ? c : '_';
    }
    return out + "_";
}

}  // namespace

Vessel vessel_of_label(std::string_view label_name) {
    constexpr std::string_view thrombus[] = {"thrombus", "thrombosed", "thrombosis"};
    constexpr std::string_view vein[] = {"vein", "veins", "vena", "cava", "venous", "portal"};
    constexpr std::string_view artery[] = {"artery", "arteries", "arterial",
                                           "aorta",  "carotid",  "trunk"};
    const std::string words = words_of(label_name);
    const auto names = [&words](const auto& list) {
        for (const std::string_view word : list)
            if (words.find("_" + std::string(word) + "_") != std::string::npos) return true;
        return false;
    };
    if (names(thrombus)) return Vessel::thrombus;
    if (names(vein)) return Vessel::vein;
    return names(artery) ? Vessel::artery : Vessel::unknown;
}

TissueMechanics built_in_mechanics(const Tissue& tissue, std::string_view label_name) {
    const Vessel vessel = vessel_of_label(label_name);
    if (tissue.name == "blood") return of_vessel(vessel);
    for (const Row& row : kRows)
        if (row.tissue == tissue.name) return row.mechanics;
    const bool blood = tissue.kind == TissueKind::fluid && vessel != Vessel::unknown;
    return blood ? of_vessel(vessel) : by_kind(tissue.kind);
}

TissueMechanics mechanics_of(const Tissue& tissue, std::string_view label_name) {
    return tissue.mechanics ? *tissue.mechanics : built_in_mechanics(tissue, label_name);
}

}  // namespace sonocase
