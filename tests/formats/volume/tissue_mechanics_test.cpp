// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/tissue.h"

#include <gtest/gtest.h>

namespace sonocase {
namespace {

Tissue tissue(const char* name, TissueKind kind) {
    Tissue t;
    t.name = name;
    t.kind = kind;
    return t;
}

TEST(TissueMechanics, BloodIsAVeinAnArteryOrAThrombusByTheNameOfItsLabel) {
    const Tissue blood = tissue("blood", TissueKind::fluid);
    for (const char* name : {"inferior_vena_cava", "portal_vein_and_splenic_vein", "Femoral Vein",
                             "hepatic_vein_2mm", "brachiocephalic_vein_left", "veins"})
        EXPECT_TRUE(mechanics_of(blood, name).drains) << name;
    // A word inside another word does not count; what says neither stays open.
    for (const char* name : {"aorta", "iliac_artery_left", "brachiocephalic_trunk", "liver_vessels",
                             "atrial_appendage_left", "veinlike", "excavation", ""}) {
        EXPECT_FALSE(mechanics_of(blood, name).drains) << name;
        EXPECT_EQ(mechanics_of(blood, name).stiffness_kpa, 60) << name;
    }
    const TissueMechanics thrombosed = mechanics_of(blood, "femoral_vein_thrombosed");
    EXPECT_FALSE(thrombosed.drains);
    EXPECT_EQ(thrombosed.stiffness_kpa, 10);
    // Blood by another name is known by its label too; bile in a "portal" cyst is not blood.
    EXPECT_TRUE(mechanics_of(tissue("dark blood", TissueKind::fluid), "femoral_vein").drains);
    EXPECT_FALSE(mechanics_of(tissue("cyst", TissueKind::fluid), "portal_cyst").drains);
}

TEST(TissueMechanics, TheRecipeComesFirstThenTheNameThenTheKind) {
    Tissue liver = tissue("liver", TissueKind::soft);
    EXPECT_EQ(mechanics_of(liver, "liver").stiffness_kpa, 6);
    liver.mechanics = TissueMechanics{20, false, 0.3, false};
    EXPECT_EQ(mechanics_of(liver, "liver"), *liver.mechanics);
    EXPECT_EQ(built_in_mechanics(liver, "liver").stiffness_kpa, 6);
    EXPECT_EQ(mechanics_of(tissue("x", TissueKind::soft), "y").stiffness_kpa, 8);
    EXPECT_EQ(mechanics_of(tissue("x", TissueKind::fluid), "y").stiffness_kpa, 1);
    EXPECT_EQ(mechanics_of(tissue("x", TissueKind::gas), "y").stiffness_kpa, 2);
    EXPECT_TRUE(mechanics_of(tissue("x", TissueKind::bone), "y").rigid);
}

TEST(TissueMechanics, EveryFigureLiesWithinItsLimits) {
    for (const char* name : {"outside",      "skin",        "fat",      "muscle",
                             "heart_muscle", "liver",       "pancreas", "kidney_cortex",
                             "kidney_sinus", "spleen",      "gland",    "lesion",
                             "brain",        "nerve",       "tendon",   "fascia",
                             "bowel",        "soft_tissue", "soft",     "cartilage",
                             "vein",         "artery",      "thrombus", "blood",
                             "urine",        "bile",        "cyst",     "cerebrospinal_fluid",
                             "gas",          "lung",        "bone",     "metal"}) {
        const TissueMechanics m = mechanics_of(tissue(name, TissueKind::soft), "");
        EXPECT_GE(m.stiffness_kpa, kMinStiffnessKpa) << name;
        EXPECT_LE(m.stiffness_kpa, kMaxStiffnessKpa) << name;
        EXPECT_GE(m.puncture_n, 0) << name;
        EXPECT_LE(m.puncture_n, kMaxPunctureN) << name;
        EXPECT_FALSE(m.rigid && m.drains) << name;
    }
}

}  // namespace
}  // namespace sonocase
