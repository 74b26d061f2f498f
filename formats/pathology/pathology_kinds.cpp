// SPDX-License-Identifier: Apache-2.0

#include "formats/pathology/pathology_kinds.h"

#include <algorithm>

namespace sonocase {
namespace {

constexpr auto kSoft = TissueKind::soft;
constexpr auto kFluid = TissueKind::fluid;
constexpr auto kBone = TissueKind::bone;
constexpr auto kGas = TissueKind::gas;

#define DONG "doi 10.1002/jcu.1870220304"
#define SHUNG "J Clin Ultrasound 14:269 (1986)"
#define GOOD "Gastroenterology 77:258 (1979)"

// Columns as in tissue_table.cpp: name, kind, shadow | texture, grey mean, grey sd | echo dB re
// liver, structure dB, attenuation dB/cm/MHz, impedance MRayl, speed m/s | source. Textures are
// those of tissues with the same grain.
const Tissue kCystFluid{"simple_cyst", kFluid, false, "fluid", 8,    3,
                        -58,           0,      0.01,  1.52,    1510, "as cyst"};
const Tissue kCystWall{"cyst_wall", kSoft, false, "fascia", 118,  14,
                       3,           0.5,   0.8,   1.66,     1580, "all (a)"};
const Tissue kPus{"abscess",
                  kFluid,
                  false,
                  "gland",
                  20,
                  8,
                  -30,
                  2,
                  0.2,
                  1.56,
                  1530,
                  "half are anechoic, a quarter bright: Diagnostic Ultrasound, Abdomen and Pelvis; "
                  "figures (a)"};
const Tissue kDebris{"abscess_debris",
                     kFluid,
                     false,
                     "gland",
                     71,
                     12,
                     -8,
                     2,
                     0.4,
                     1.58,
                     1540,
                     "doi 10.2214/ajr.149.3.499 shows layers; figures (a)"};
const Tissue kAbscessWall{"abscess_wall", kSoft, false,    "gland", 118, 16, 3, 1.5, 0.8,
                          1.65,           1570,  "all (a)"};
const Tissue kSepta{"lesion_septa", kSoft, false,    "fascia", 114, 16, 2, 1, 0.8,
                    1.65,           1580,  "all (a)"};
const Tissue kBubbles{"abscess_gas",     kGas, true, "gas", 130, 24, -4, 2, 7.5, 0.0004, 330,
                      "as gas; echo (a)"};
const Tissue kHaemangioma{"haemangioma", kSoft, false, "liver",
                          135,           14,    7,     1,
                          0.29,          1.63,  1580,  "attenuation " DONG "; others (a)"};
const Tissue kHcc{"hcc", kSoft, false, "gland", 80,   16,
                  -6,    4,     0.43,  1.65,    1590, "attenuation " DONG "; others (a)"};
const Tissue kHccHalo{"hcc_halo", kSoft, false, "gland", 58,   10,
                      -11,        1,     0.45,  1.64,    1585, "all (a)"};
const Tissue kMetastasis{"metastasis", kSoft, false, "gland",
                         101,          14,    -1,    2,
                         0.41,         1.65,  1590,  "attenuation " DONG "; others (a)"};
const Tissue kMetastasisHalo{"metastasis_halo",
                             kSoft,
                             false,
                             "gland",
                             58,
                             10,
                             -11,
                             1,
                             0.41,
                             1.64,
                             1585,
                             "attenuation " DONG "; others (a)"};
const Tissue kAdenoma{"adenoma", kSoft, false, "liver", 105,  15,
                      0,         1.5,   0.66,  1.66,    1595, "attenuation " DONG "; others (a)"};
const Tissue kScar{"adenoma_scar", kSoft, false,    "gland", 80, 12, -6, 1, 0.7,
                   1.66,           1595,  "all (a)"};
const Tissue kGallstone{"gallstone",
                        kBone,
                        true,
                        "bone",
                        190,
                        34,
                        -6,
                        2,
                        15,
                        6.5,
                        3600,
                        "impedance 4.9 to 8.3, speed 3150 to 4160: stone models that cover natural "
                        "ones; attenuation (a)"};
const Tissue kKidneyStone{"kidney_stone",
                          kBone,
                          true,
                          "bone",
                          190,
                          34,
                          7,
                          2,
                          15,
                          6.0,
                          3400,
                          "PMC5695736: on average as bright as sinus fat; attenuation (a)"};
// A vessel is of the tissue that labels of vessels have, which every case has.
const Tissue kBlood{"blood", kFluid, false, "fluid", 15, 5, -30, 0, 0.15, 1.61, 1570, "as blood"};
const Tissue kUrine{"hydronephrosis", kFluid, false, "fluid", 6, 3, -60, 0, 0.01, 1.52, 1500,
                    "as urine"};
const Tissue kAscites{"ascites", kFluid, false, "fluid", 8, 3, -58, 0, 0.01, 1.52, 1510, "as cyst"};
const Tissue kHaemoperitoneum{"haemoperitoneum",
                              kFluid,
                              false,
                              "fluid",
                              22,
                              8,
                              -20,
                              1,
                              0.15,
                              1.61,
                              1570,
                              "attenuation as blood; echo (a)"};
const Tissue kEffusion{"pleural_effusion", kFluid, false, "fluid", 8, 3, -58, 0, 0.01, 1.52, 1510,
                       "as cyst"};
const Tissue kThrombus{"old_thrombus",
                       kSoft,
                       false,
                       "gland",
                       54,
                       14,
                       -12,
                       1.5,
                       0.43,
                       1.62,
                       1580,
                       "echo and attenuation " SHUNG "; others (a)"};
const Tissue kAneurysm{"aneurysm", kFluid, false, "fluid", 15,   5,
                       -30,        0,      0.15,  1.61,    1570, "as blood"};
const Tissue kNodeCortex{"lymph_node", kSoft, false, "gland", 67,   12,
                         -9,           1,     0.6,   1.63,    1560, "all (a)"};
const Tissue kNodeHilum{"lymph_node_hilum", kSoft, false, "gland", 122, 20, 4, 2, 0.6, 1.50, 1490,
                        "all (a)"};
const Tissue kFascicles{"peripheral_nerve",
                        kSoft,
                        false,
                        "gland",
                        71,
                        20,
                        -6,
                        5,
                        0.8,
                        1.63,
                        1570,
                        "PMC8104199: honeycomb of 0.7 mm; figures (a)"};
const Tissue kEpineurium{"epineurium", kSoft, false, "fascia", 130, 20, 6, 1,
                         0.8,          1.66,  1600,  "all (a)"};
const Tissue kCatheterWall{"catheter_wall",
                           kSoft,
                           false,
                           "fascia",
                           150,
                           20,
                           10,
                           0,
                           3,
                           2.4,
                           1900,
                           "two bright walls; figures (a)"};
const Tissue kCatheterLumen{"catheter", kFluid, false, "fluid", 8,    3,
                            -58,        0,      0.05,  1.52,    1510, "as water; (a)"};
const Tissue kForeignBody{
    "foreign_body", kBone, true, "bone", 210, 30, -4, 0, 15, 20, 4000, "as metal or glass; (a)"};

std::vector<PathologyKind> make_kinds() {
    using enum LesionShape;
    using enum PartPlace;
    return {
        {"simple_cyst",
         ellipsoid,
         false,
         1.15,
         0.04,
         1,
         kCystFluid,
         {{"wall", shell, 0.5, kCystWall}},
         "anechoic, thin wall; enhancement behind it"},
        {"complex_cyst",
         ellipsoid,
         false,
         1.2,
         0.06,
         1,
         kCystFluid,
         {{"wall", shell, 1.5, kCystWall}, {"septa", septa, 2, kSepta}},
         "anechoic with septa and a thicker wall"},
        {"abscess",
         ellipsoid,
         false,
         1.3,
         0.12,
         1,
         kPus,
         {{"wall", shell, 3, kAbscessWall},
          {"debris", debris, 0.35, kDebris},
          {"gas", gas, 0, kBubbles}},
         "fluid with debris in layers, shaggy wall; gas bubbles by choice"},
        {"haemangioma",
         ellipsoid,
         false,
         1.15,
         0.06,
         1,
         kHaemangioma,
         {},
         "bright and sharp; slight enhancement"},
        {"hcc",
         ellipsoid,
         false,
         1.25,
         0.1,
         1,
         kHcc,
         {{"halo", shell, 1.5, kHccHalo}},
         "dark, mixed when large, thin halo"},
        {"metastasis",
         ellipsoid,
         false,
         1.3,
         0.12,
         1,
         kMetastasis,
         {{"halo", shell, 3, kMetastasisHalo}},
         "target: core like liver, dark halo"},
        {"adenoma",
         ellipsoid,
         false,
         1.2,
         0.06,
         1,
         kAdenoma,
         {{"scar", core, 0.3, kScar}},
         "as bright as liver; a scar in the middle"},
        {"gallstone",
         ellipsoid,
         true,
         1.1,
         0.03,
         1,
         kGallstone,
         {},
         "bright face; shadow from 4 mm (" GOOD "); lies lowest"},
        {"kidney_stone",
         ellipsoid,
         false,
         1.2,
         0.05,
         1,
         kKidneyStone,
         {},
         "bright face, shadow where it is large enough"},
        {"hydronephrosis",
         swell,
         false,
         1,
         0,
         1,
         kUrine,
         {},
         "urine from the pelvis outwards; 10, 30, 60, 120 ml look like grades 1 to 4 (a)"},
        {"ascites", pool, false, 1, 0, 1, kAscites, {}, "free fluid in the lowest recess"},
        {"haemoperitoneum", pool, false, 1, 0, 1, kHaemoperitoneum, {}, "free blood; FAST"},
        {"pleural_effusion", pool, false, 1, 0, 1, kEffusion, {}, "fluid lowest in the chest"},
        {"thrombus", tube, false, 1, 0, 1, kThrombus, {}, "fills a share of a vessel"},
        {"aneurysm",
         ellipsoid,
         false,
         1,
         0.03,
         1.6,
         kAneurysm,
         {{"thrombus", rim, 4, kThrombus}},
         "wide vessel with thrombus along its wall"},
        {"lymph_node",
         ellipsoid,
         false,
         1.05,
         0.04,
         2,
         kNodeCortex,
         {{"hilum", core, 0.4, kNodeHilum}},
         "oval, dark cortex, bright hilum"},
        {"nerve",
         tube,
         false,
         1,
         0,
         1,
         kFascicles,
         {{"sheath", shell, 0.7, kEpineurium}},
         "dark fascicles in a bright sheath"},
        {"catheter",
         tube,
         false,
         1,
         0,
         1,
         kCatheterLumen,
         {{"wall", shell, 0.7, kCatheterWall}},
         "two bright lines"},
        {"vessel",
         tube,
         false,
         1,
         0,
         1,
         kBlood,
         {},
         "an artery or a vein that the map lacks, by its name"},
        {"foreign_body", tube, false, 1, 0, 1, kForeignBody, {}, "bright line with a shadow"},
    };
}

const std::vector<PathologyKind>& kinds() {
    static const std::vector<PathologyKind> table = make_kinds();
    return table;
}

}  // namespace

std::span<const PathologyKind> pathology_kinds() {
    return kinds();
}

const PathologyKind* find_pathology_kind(std::string_view name) {
    const auto found = std::find_if(kinds().begin(), kinds().end(),
                                    [&](const PathologyKind& kind) { return kind.name == name; });
    return found == kinds().end() ? nullptr : &*found;
}

std::vector<std::string> pathology_kind_names() {
    std::vector<std::string> names;
    for (const PathologyKind& kind : kinds()) names.push_back(kind.name);
    return names;
}

bool drawn_per_attempt(const PathologyKind& kind) {
    const auto plain = [](const LesionPart& part) {
        return part.tissue.kind == TissueKind::soft &&
               (part.place == PartPlace::shell || part.place == PartPlace::core);
    };
    return kind.shape == LesionShape::ellipsoid && !kind.settles &&
           (kind.tissue.kind == TissueKind::soft || kind.tissue.kind == TissueKind::fluid) &&
           std::all_of(kind.parts.begin(), kind.parts.end(), plain);
}

std::vector<std::string> kinds_drawn_per_attempt() {
    std::vector<std::string> names;
    for (const PathologyKind& kind : kinds())
        if (drawn_per_attempt(kind)) names.push_back(kind.name);
    return names;
}

}  // namespace sonocase
