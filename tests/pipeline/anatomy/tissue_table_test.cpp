// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/tissue_table.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "pipeline/anatomy/analytic_torso.h"

namespace sonocase::pipeline {
namespace {

TEST(TissueTable, EveryTotalSegmentatorLabelHasARule) {
    EXPECT_EQ(total_segmentator_labels().size(), 117u);
    std::set<std::string_view> names;
    for (const std::string_view label : total_segmentator_labels()) {
        const TissueChoice choice = tissue_for_label(label);
        EXPECT_TRUE(choice.known) << label;
        EXPECT_NE(find_tissue(choice.tissue), nullptr) << label;
        EXPECT_TRUE(names.insert(label).second) << label << " twice";
    }
    EXPECT_EQ(total_segmentator_labels()[4], "liver");
    EXPECT_EQ(total_segmentator_labels()[24], "sacrum");
    EXPECT_EQ(total_segmentator_labels()[97], "rib_left_7");
    EXPECT_EQ(total_segmentator_labels()[116], "costal_cartilages");
}

TEST(TissueTable, LabelsBecomeTheTissueThatTheyAreMadeOf) {
    const std::pair<const char*, const char*> expected[] = {
        {"liver", "liver"},
        {"kidney_right", "kidney_cortex"},
        {"kidney_cyst_left", "cyst"},
        {"gallbladder", "bile"},
        {"urinary_bladder", "urine"},
        {"portal_vein_and_splenic_vein", "blood"},
        {"atrial_appendage_left", "blood"},
        {"adrenal_gland_left", "gland"},
        {"vertebrae_L3", "bone"},
        {"costal_cartilages", "cartilage"},
        {"rib_left_12", "bone"},
        {"spinal_cord", "nerve"},
        {"autochthon_left", "muscle"},
        {"lung_middle_lobe_right", "lung"},
        {"trachea", "gas"},
        {"outside_body", "outside"},
        {"other_soft_tissue", "soft_tissue"},
        {"other_fat", "fat"},
        {"other_muscle_like", "muscle"},
        {"gas_in_body", "gas"},
        {"skin", "skin"},
        {"other_dense_bone_or_metal", "bone"},
        {"Liver", "liver"},
        {"left kidney", "kidney_cortex"},
    };
    for (const auto& [label, tissue] : expected)
        EXPECT_EQ(tissue_for_label(label).tissue, tissue) << label;
}

TEST(TissueTable, UnknownLabelTakesTheDefaultAndSaysSo) {
    const TissueChoice choice = tissue_for_label("xyzzy");
    EXPECT_FALSE(choice.known);
    EXPECT_EQ(choice.tissue, "soft_tissue");
    EXPECT_FALSE(tissue_for_label("").known);
    // a word inside another word does not match
    EXPECT_FALSE(tissue_for_label("hipster").known);
}

TEST(TissueTable, EntriesArePhysical) {
    std::set<std::string> names;
    for (const Tissue& t : built_in_tissues()) {
        EXPECT_TRUE(names.insert(t.name).second) << t.name;
        EXPECT_FALSE(t.source.empty()) << t.name;
        EXPECT_GE(t.grey_mean, 0) << t.name;
        EXPECT_LE(t.grey_mean, 255) << t.name;
        EXPECT_GE(t.attenuation_db_cm_mhz, 0) << t.name;
        EXPECT_GT(t.impedance_mrayl, 0) << t.name;
        EXPECT_GT(t.sound_speed_m_s, 300) << t.name;
        // impedance = density * speed: soft tissue and fluid have a density near that of water
        if (t.kind == TissueKind::soft || t.kind == TissueKind::fluid) {
            const double density = 1000 * t.impedance_mrayl / t.sound_speed_m_s;
            EXPECT_GT(density, 0.9) << t.name;
            EXPECT_LT(density, 1.2) << t.name;
        }
        if (t.kind == TissueKind::fluid) {
            EXPECT_LT(t.echo_db, -25) << t.name;
        }
        EXPECT_EQ(t.casts_shadow, t.kind == TissueKind::bone || t.kind == TissueKind::gas)
            << t.name;
    }
    EXPECT_EQ(built_in_tissues()[0].name, "outside");
    EXPECT_EQ(find_tissue("liver")->echo_db, 0);
    EXPECT_EQ(find_tissue("nothing"), nullptr);
}

TEST(TissueTable, AnalyticTorsoNamesOnlyKnownTissues) {
    for (const Label& label : analytic_torso_labels()) {
        EXPECT_NE(find_tissue(label.tissue), nullptr) << label.name << " is of " << label.tissue;
        EXPECT_TRUE(tissue_for_label(label.name).known) << label.name;
        EXPECT_EQ(tissue_for_label(label.name).tissue, label.tissue) << label.name;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
