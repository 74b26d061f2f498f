// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/tissue_table.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <vector>

namespace sonocase::pipeline::inline anatomy {
namespace {

// Sources of the figures, as in docs/textures.md.
#define S1 "PMC10001275 table 4"
#define S2 "PMC10346919 table A2"
#define S3 "PMC3233242 table 3"
#define S4 "doi 10.1016/s0301-5629(99)00055-1"
#define S5 "doi 10.1109/58.677618"
#define S6 "Fei and Shung, J. Acoust. Soc. Am. 78:871"
#define S7 "doi 10.2214/AJR.07.4016"
#define S8 "Radiology 210:113 (1999)"
#define S9 "doi 10.1016/0301-5629(92)90099-v"

constexpr auto kSoft = TissueKind::soft;
constexpr auto kFluid = TissueKind::fluid;
constexpr auto kGas = TissueKind::gas;
constexpr auto kBone = TissueKind::bone;

// Columns: name, kind, shadow | texture, grey mean, grey sd | echo dB, structure dB, attenuation
// dB/cm/MHz, impedance MRayl, speed m/s | source.
// Grey of the model "paper": 105 for liver and 4.25 levels per dB (255 over a range of 60 dB) where
// only the echogenicity is known; muscle, fat, fascia and shadow as measured on images of living
// tissue.
const std::vector<Tissue>& table() {
    static const std::vector<Tissue> tissues = {
        {"outside", TissueKind::outside, false, "", 0, 0, -60, 0, 0, 0.0004, 343, "air; echo (a)"},
        {"skin", kSoft, false, "skin", 140, 22, 9, 1.5, 0.35, 1.75, 1615,
         "attenuation " S1 "; impedance, speed " S3 " (" S2 ": 1.99, 1730); echo (a)"},
        {"fat", kSoft, false, "fat", 86, 34, -7, 5, 0.63, 1.38, 1460,
         "attenuation " S1 "; impedance, speed " S2 "; grey from living fat; echo (a)"},
        {"muscle", kSoft, false, "muscle", 84, 32, -8, 6, 1.0, 1.70, 1580,
         "attenuation " S1 " (0.96 across, 1.40 along); impedance, speed " S2
         "; grey from living muscle; echo (a)"},
        {"liver", kSoft, false, "liver", 105, 15, 0, 1.3, 0.5, 1.65, 1595,
         "attenuation " S1 ", " S4 "; impedance, speed " S3 "; structure " S5
         "; grey is the reference (a)"},
        {"spleen", kSoft, false, "spleen", 101, 14, -1, 0.9, 0.40, 1.64, 1567,
         "attenuation " S1 "; impedance, speed " S3 "; weaker scatter than liver " S6 "; echo (a)"},
        {"kidney_cortex", kSoft, false, "kidney_cortex", 88, 15, -4, 1.2, 0.7, 1.62, 1560,
         "impedance, speed " S3 "; not above liver " S7 "; attenuation between 0.7 and 1.0 of " S1
         "; echo (a)"},
        {"kidney_sinus", kSoft, false, "kidney_sinus", 135, 28, 7, 3.5, 0.7, 1.48, 1500, "all (a)"},
        {"pancreas", kSoft, false, "pancreas", 114, 18, 2, 2.5, 0.7, 1.63, 1570, "all (a)"},
        {"gland", kSoft, false, "gland", 92, 15, -3, 1.5, 0.6, 1.62, 1560,
         "adrenal, prostate, thyroid; all (a)"},
        {"heart_muscle", kSoft, false, "gland", 82, 18, -5, 2.0, 0.7, 1.66, 1572,
         "speed " S3 "; others (a)"},
        {"brain", kSoft, false, "spleen", 80, 14, -6, 2.0, 0.6, 1.60, 1550,
         "speed " S3 "; others (a)"},
        {"nerve", kSoft, false, "gland", 70, 16, -8, 1.5, 0.8, 1.63, 1570,
         "spinal cord and nerves; all (a)"},
        {"tendon", kSoft, false, "fascia", 160, 36, 10, 3, 1.6, 1.98, 1750,
         "attenuation " S1 " (connective tissue); impedance, speed " S3 "; echo (a)"},
        {"fascia", kSoft, false, "fascia", 175, 36, 10, 3, 1.6, 1.98, 1750,
         "attenuation " S1 " (connective tissue); impedance, speed " S3 "; grey from a living "
         "aponeurosis; echo (a)"},
        {"bowel", kSoft, false, "bowel", 98, 24, -1, 4, 0.6, 1.60, 1580, "all (a)"},
        {"soft_tissue", kSoft, false, "soft_tissue", 88, 20, -4, 2, 0.6, 1.62, 1550,
         "default for labels without a rule; all (a)"},
        {"lesion", kSoft, false, "gland", 76, 14, -7, 1.5, 0.6, 1.64, 1570,
         "tumour darker than liver; all (a)"},
        {"cartilage", kSoft, false, "cartilage", 66, 10, -9, 1.5, 1.8, 1.85, 1665,
         "speed " S3 "; echo, attenuation, impedance (a)"},
        {"blood", kFluid, false, "fluid", 15, 5, -30, 0, 0.15, 1.61, 1570,
         "attenuation " S1 "; impedance, speed (a); lumen grey 0 to 58 in example images"},
        // Blood whose vessel a recipe names: the label's own name may not say it.
        {"vein", kFluid, false, "fluid", 15, 5, -30, 0, 0.15, 1.61, 1570, "as blood"},
        {"artery", kFluid, false, "fluid", 15, 5, -30, 0, 0.15, 1.61, 1570, "as blood"},
        {"thrombus", kSoft, false, "gland", 62, 14, -11, 1.5, 0.25, 1.63, 1580, "all (a)"},
        {"urine", kFluid, false, "fluid", 6, 3, -60, 0, 0.01, 1.52, 1500,
         "water " S1 " 0.0022; all (a)"},
        {"bile", kFluid, false, "fluid", 8, 3, -60, 0, 0.01, 1.52, 1500,
         "water " S1 " 0.0022; all (a)"},
        {"cyst", kFluid, false, "fluid", 8, 3, -58, 0, 0.01, 1.52, 1510, "all (a)"},
        {"cerebrospinal_fluid", kFluid, false, "fluid", 8, 3, -60, 0, 0.01, 1.51, 1505, "all (a)"},
        {"gas", kGas, true, "gas", 60, 24, -14, 3, 7.5, 0.0004, 330,
         "attenuation " S1 "; dirty shadow " S8 "; impedance, speed (a)"},
        {"lung", kGas, true, "gas", 74, 24, -8, 2, 12, 0.2, 650,
         "attenuation below the 40 of " S1 "; all (a)"},
        {"bone", kBone, true, "bone", 190, 34, -6, 2, 15, 6.5, 3430,
         "attenuation, impedance, speed " S1 ", " S2 " (" S9 " gives 7 to 10 dB); echo (a)"},
        {"metal", kBone, true, "bone", 210, 30, -6, 0, 15, 45, 5900,
         "steel (a); " S2 " gives 51.9 MRayl for cobalt-chrome"},
    };
    return tissues;
}

constexpr std::array<std::string_view, 117> kTotalSegmentator = {"spleen",
                                                                 "kidney_right",
                                                                 "kidney_left",
                                                                 "gallbladder",
                                                                 "liver",
                                                                 "stomach",
                                                                 "pancreas",
                                                                 "adrenal_gland_right",
                                                                 "adrenal_gland_left",
                                                                 "lung_upper_lobe_left",
                                                                 "lung_lower_lobe_left",
                                                                 "lung_upper_lobe_right",
                                                                 "lung_middle_lobe_right",
                                                                 "lung_lower_lobe_right",
                                                                 "esophagus",
                                                                 "trachea",
                                                                 "thyroid_gland",
                                                                 "small_bowel",
                                                                 "duodenum",
                                                                 "colon",
                                                                 "urinary_bladder",
                                                                 "prostate",
                                                                 "kidney_cyst_left",
                                                                 "kidney_cyst_right",
                                                                 "sacrum",
                                                                 "vertebrae_S1",
                                                                 "vertebrae_L5",
                                                                 "vertebrae_L4",
                                                                 "vertebrae_L3",
                                                                 "vertebrae_L2",
                                                                 "vertebrae_L1",
                                                                 "vertebrae_T12",
                                                                 "vertebrae_T11",
                                                                 "vertebrae_T10",
                                                                 "vertebrae_T9",
                                                                 "vertebrae_T8",
                                                                 "vertebrae_T7",
                                                                 "vertebrae_T6",
                                                                 "vertebrae_T5",
                                                                 "vertebrae_T4",
                                                                 "vertebrae_T3",
                                                                 "vertebrae_T2",
                                                                 "vertebrae_T1",
                                                                 "vertebrae_C7",
                                                                 "vertebrae_C6",
                                                                 "vertebrae_C5",
                                                                 "vertebrae_C4",
                                                                 "vertebrae_C3",
                                                                 "vertebrae_C2",
                                                                 "vertebrae_C1",
                                                                 "heart",
                                                                 "aorta",
                                                                 "pulmonary_vein",
                                                                 "brachiocephalic_trunk",
                                                                 "subclavian_artery_right",
                                                                 "subclavian_artery_left",
                                                                 "common_carotid_artery_right",
                                                                 "common_carotid_artery_left",
                                                                 "brachiocephalic_vein_left",
                                                                 "brachiocephalic_vein_right",
                                                                 "atrial_appendage_left",
                                                                 "superior_vena_cava",
                                                                 "inferior_vena_cava",
                                                                 "portal_vein_and_splenic_vein",
                                                                 "iliac_artery_left",
                                                                 "iliac_artery_right",
                                                                 "iliac_vena_left",
                                                                 "iliac_vena_right",
                                                                 "humerus_left",
                                                                 "humerus_right",
                                                                 "scapula_left",
                                                                 "scapula_right",
                                                                 "clavicula_left",
                                                                 "clavicula_right",
                                                                 "femur_left",
                                                                 "femur_right",
                                                                 "hip_left",
                                                                 "hip_right",
                                                                 "spinal_cord",
                                                                 "gluteus_maximus_left",
                                                                 "gluteus_maximus_right",
                                                                 "gluteus_medius_left",
                                                                 "gluteus_medius_right",
                                                                 "gluteus_minimus_left",
                                                                 "gluteus_minimus_right",
                                                                 "autochthon_left",
                                                                 "autochthon_right",
                                                                 "iliopsoas_left",
                                                                 "iliopsoas_right",
                                                                 "brain",
                                                                 "skull",
                                                                 "rib_left_1",
                                                                 "rib_left_2",
                                                                 "rib_left_3",
                                                                 "rib_left_4",
                                                                 "rib_left_5",
                                                                 "rib_left_6",
                                                                 "rib_left_7",
                                                                 "rib_left_8",
                                                                 "rib_left_9",
                                                                 "rib_left_10",
                                                                 "rib_left_11",
                                                                 "rib_left_12",
                                                                 "rib_right_1",
                                                                 "rib_right_2",
                                                                 "rib_right_3",
                                                                 "rib_right_4",
                                                                 "rib_right_5",
                                                                 "rib_right_6",
                                                                 "rib_right_7",
                                                                 "rib_right_8",
                                                                 "rib_right_9",
                                                                 "rib_right_10",
                                                                 "rib_right_11",
                                                                 "rib_right_12",
                                                                 "sternum",
                                                                 "costal_cartilages"};

struct Rule {
    std::string_view word;  // matched against whole words of the label's name
    std::string_view tissue;
};

// The first match counts: special cases come before general ones. A word of the table matches a run
// of words in the name: "adrenal_gland" matches "adrenal_gland_left".
constexpr Rule kRules[] = {
    {"outside_body", "outside"},
    {"outside", "outside"},
    {"background", "outside"},
    {"air", "outside"},
    // The material says more than the place: stomach_gas, bladder_wall, gallstone.
    {"abdominal_wall", "muscle"},
    {"chest_wall", "muscle"},
    {"gas", "gas"},
    {"stone", "bone"},
    {"stones", "bone"},
    {"gallstone", "bone"},
    {"halo", "lesion"},
    {"wall", "soft_tissue"},
    {"kidney_cyst", "cyst"},
    {"cyst", "cyst"},
    {"abscess", "cyst"},
    {"ascites", "cyst"},
    {"kidney_sinus", "kidney_sinus"},
    {"renal_sinus", "kidney_sinus"},
    {"sinus", "kidney_sinus"},
    {"liver_vessel", "blood"},
    {"vessel", "blood"},
    {"vessels", "blood"},
    {"aorta", "blood"},
    {"artery", "blood"},
    {"arteries", "blood"},
    {"vein", "blood"},
    {"veins", "blood"},
    {"vena", "blood"},
    {"venous", "blood"},
    {"cava", "blood"},
    {"brachiocephalic", "blood"},
    {"atrial", "blood"},
    {"blood", "blood"},
    {"portal", "blood"},
    {"lumen", "blood"},
    {"ventricle", "blood"},
    {"atrium", "blood"},
    {"tumour", "lesion"},
    {"tumor", "lesion"},
    {"lesion", "lesion"},
    {"metastasis", "lesion"},
    {"costal_cartilages", "cartilage"},
    {"cartilage", "cartilage"},
    {"cartilages", "cartilage"},
    {"disc", "cartilage"},
    {"discs", "cartilage"},
    {"liver", "liver"},
    {"spleen", "spleen"},
    {"kidney", "kidney_cortex"},
    {"kidneys", "kidney_cortex"},
    {"renal", "kidney_cortex"},
    {"pancreas", "pancreas"},
    {"gallbladder", "bile"},
    {"bile", "bile"},
    {"gall", "bile"},
    {"urinary_bladder", "urine"},
    {"bladder", "urine"},
    {"urine", "urine"},
    {"ureter", "urine"},
    {"stomach", "bowel"},
    {"esophagus", "bowel"},
    {"oesophagus", "bowel"},
    {"small_bowel", "bowel"},
    {"bowel", "bowel"},
    {"duodenum", "bowel"},
    {"colon", "bowel"},
    {"rectum", "bowel"},
    {"intestine", "bowel"},
    {"gut", "bowel"},
    {"adrenal", "gland"},
    {"prostate", "gland"},
    {"thyroid", "gland"},
    {"gland", "gland"},
    {"uterus", "gland"},
    {"ovary", "gland"},
    {"testis", "gland"},
    {"lung", "lung"},
    {"lungs", "lung"},
    {"trachea", "gas"},
    {"gas_in_body", "gas"},
    {"gas", "gas"},
    {"bronchus", "gas"},
    {"heart", "heart_muscle"},
    {"myocardium", "heart_muscle"},
    {"spinal_cord", "nerve"},
    {"spinal_canal", "cerebrospinal_fluid"},
    {"nerve", "nerve"},
    {"cerebrospinal", "cerebrospinal_fluid"},
    {"brain", "brain"},
    {"metal", "bone"},
    {"implant", "metal"},
    {"needle", "metal"},
    {"sacrum", "bone"},
    {"vertebrae", "bone"},
    {"vertebra", "bone"},
    {"spine", "bone"},
    {"skull", "bone"},
    {"rib", "bone"},
    {"ribs", "bone"},
    {"sternum", "bone"},
    {"humerus", "bone"},
    {"scapula", "bone"},
    {"clavicula", "bone"},
    {"clavicle", "bone"},
    {"femur", "bone"},
    {"hip", "bone"},
    {"bone", "bone"},
    {"bones", "bone"},
    {"pelvis", "bone"},
    {"gluteus", "muscle"},
    {"autochthon", "muscle"},
    {"iliopsoas", "muscle"},
    {"psoas", "muscle"},
    {"abdominal_wall", "muscle"},
    {"diaphragm", "muscle"},
    {"muscle", "muscle"},
    {"muscles", "muscle"},
    {"fascia", "fascia"},
    {"tendon", "tendon"},
    {"ligament", "tendon"},
    {"fat", "fat"},
    {"subcutaneous", "fat"},
    {"adipose", "fat"},
    {"skin", "skin"},
    {"soft_tissue", "soft_tissue"},
    {"body", "soft_tissue"},
};

std::string lower_words(std::string_view name) {
    std::string out = "_";
    for (const char c : name) {
        const auto u = static_cast<unsigned char>(c);
        out += std::isalnum(u) ? static_cast<char>(std::tolower(u)) : '_';
    }
    return out + "_";
}

}  // namespace

std::span<const Tissue> built_in_tissues() {
    return table();
}

const Tissue* find_tissue(std::string_view name) {
    for (const Tissue& tissue : table()) {
        if (tissue.name == name) return &tissue;
    }
    return nullptr;
}

TissueChoice tissue_for_label(std::string_view label_name) {
    const std::string words = lower_words(label_name);
    // The name of a tissue is that tissue, whatever words it contains.
    const std::string bare = words.substr(1, words.size() - 2);
    if (const Tissue* tissue = find_tissue(bare)) return {tissue->name, true};
    for (const Rule& rule : kRules) {
        if (words.find("_" + std::string(rule.word) + "_") != std::string::npos) {
            return {rule.tissue, true};
        }
    }
    return {"soft_tissue", false};
}

std::span<const std::string_view> total_segmentator_labels() {
    return kTotalSegmentator;
}

}  // namespace sonocase::pipeline::inline anatomy
