// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/place_pathology.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/pathology/answer_key.h"
#include "support/hard_case.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using testing::count_label;
using testing::HardCase;

// A body of fat (1) with a liver (2), a vessel through it (3), a bladder of bile (4), a bone (5)
// and a lung (6), in 2 mm.
struct Phantom {
    explicit Phantom(double voxel_mm = 2) {
        const int edge = static_cast<int>(160 / voxel_mm) + 1;
        volume = testing::sample_labels(testing::cubic_grid(edge, voxel_mm), 7, [](Point3 p) {
            if (testing::norm_of(p) > 76) return 0;
            if (std::hypot(p.y - 5, p.z) < 4 && std::abs(p.x) < 60) return 3;
            if (testing::norm_of({p.x, p.y, p.z - 42}) < 14) return 4;
            if (p.y < -55) return 5;
            if (p.z < -55) return 6;
            return std::hypot(p.x, p.y, p.z + 8) < 45 ? 2 : 1;
        });
        const char* names[] = {"outside",     "other_fat", "liver", "portal_vein",
                               "gallbladder", "spine",     "lung"};
        const char* of[] = {"outside", "fat", "liver", "blood", "bile", "bone", "lung"};
        for (std::size_t l = 0; l < 7; ++l) {
            volume.labels[l].name = names[l];
            volume.labels[l].tissue = of[l];
        }
        const auto built_in = built_in_tissues();
        tissues.assign(built_in.begin(), built_in.end());
    }
    Result<PathologyResult> place(std::vector<PathologyRequest> requests) {
        std::vector<Tissue> all = tissues;
        for (const Tissue& tissue : pathology_tissues(requests)) all.push_back(tissue);
        return place_pathology({volume, {}, volume.labels, all, requests, "case.toml", {}});
    }
    LabelVolume volume;
    std::vector<Tissue> tissues;
};

PathologyRequest lesion(const std::string& kind, double volume_ml, int seed = 1) {
    PathologyRequest request;
    request.name = "it";
    request.kind = kind;
    request.host = {"liver"};
    request.volume_ml = volume_ml;
    request.seed = seed;
    request.line = 7;
    return request;
}

std::string refusal(Phantom& phantom, std::vector<PathologyRequest> requests) {
    const auto result = phantom.place(std::move(requests));
    return result ? "placed" : result.error().message();
}

TEST(Pathology, VolumesAreThoseAskedForOverSeedsAndSizes) {
    Phantom phantom;
    HardCase off("volume of a lesion, off, half a voxel being .004", HardCase::at_most, 0.0041,
                 "ml");
    for (const double ml : {2.0, 4.0, 14.0})
        for (int seed = 1; seed <= 7; ++seed) {
            const auto placed = phantom.place({lesion("haemangioma", ml, seed)});
            ASSERT_TRUE(placed) << placed.error().message();
            off.see(std::abs(placed->key[0].volume_ml - ml));
            const auto voxels = static_cast<double>(count_label(placed->volume, 7));
            EXPECT_NEAR(voxels * 0.008, ml, 0.0041);
        }
}

TEST(Pathology, NothingButTheHostIsReplaced) {
    Phantom phantom;
    const auto placed = phantom.place({lesion("metastasis", 9)});
    ASSERT_TRUE(placed);
    ASSERT_EQ(placed->volume.labels.size(), 9u);
    EXPECT_EQ(placed->volume.labels[7].name, "it");
    EXPECT_EQ(placed->volume.labels[8].name, "it_halo");
    std::size_t wrong = 0;
    for (std::size_t n = 0; n < phantom.volume.voxels.size(); ++n)
        wrong +=
            placed->volume.voxels[n] != phantom.volume.voxels[n] && phantom.volume.voxels[n] != 2;
    EXPECT_EQ(wrong, 0u);
}

TEST(Pathology, KeepsItsClearancesAndTellsThem) {
    Phantom phantom;
    PathologyRequest request = lesion("simple_cyst", 4);
    request.vessel_mm = 6;
    for (int seed = 1; seed <= 10; ++seed) {
        request.seed = seed;
        const auto placed = phantom.place({request});
        ASSERT_TRUE(placed) << placed.error().message();
        EXPECT_EQ(placed->key[0].vessel, "portal_vein");
        EXPECT_GE(placed->key[0].vessel_mm, 5);  // sampled surface: half a voxel
        const Point3 c = placed->key[0].centre;
        EXPECT_LT(std::hypot(c.x, c.y, c.z + 8), 45 - 9.8 + 1);
    }
}

TEST(Pathology, SameSeedSameVoxelsOnAnyNumberOfThreads) {
    Phantom phantom;
    const auto many = phantom.place({lesion("abscess", 12, 3)});
    const ThreadLimit one(1);
    const auto single = phantom.place({lesion("abscess", 12, 3)});
    const auto other = phantom.place({lesion("abscess", 12, 4)});
    ASSERT_TRUE(many && single && other);
    EXPECT_EQ(many->volume.voxels, single->volume.voxels);
    EXPECT_EQ(many->key[0].digest, single->key[0].digest);
    EXPECT_NE(many->key[0].digest, other->key[0].digest);
}

TEST(Pathology, TheKeyAgreesWithTheVoxelsAndSurvivesTheReport) {
    Phantom phantom;
    PathologyRequest request = lesion("haemangioma", 4.19);
    request.elongation = 1;
    request.roughness = 0;
    request.centre = Point3{0.7, -20.4, -12.9};  // off the lattice, whose shells are uneven
    const auto placed = phantom.place({request});
    ASSERT_TRUE(placed) << placed.error().message();
    const PathologyEntry& e = placed->key[0];
    EXPECT_LT(distance(e.centre, *request.centre), 0.2);  // a ball about the centre
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(e.diameters_mm[axis], 20, 0.5);  // a quarter voxel
    // From the ball at 76 mm to its nearest point.
    EXPECT_NEAR(e.depth_mm, 76 - testing::norm_of(*request.centre) - 10, 2);
    const auto read = key_of(placed->report);
    ASSERT_EQ(read.size(), 1u);
    EXPECT_EQ(read[0].centre, e.centre);
    EXPECT_EQ(read[0].digest, e.digest);
    EXPECT_EQ(read[0].kind, "haemangioma");
}

TEST(Pathology, AStoneLiesLowestAndFluidHasALevel) {
    Phantom phantom(1.5);
    PathologyRequest stone = lesion("gallstone", 0);
    stone.host = {"gallbladder"};
    stone.volume_ml = 0;
    stone.diameter_mm = 8;
    const auto placed = phantom.place({stone});
    ASSERT_TRUE(placed) << placed.error().message();
    // The gallbladder is a ball of 14 mm about (0, 0, 42); gravity pulls to -y.
    EXPECT_NEAR(placed->key[0].centre.y, -10, 1.6);
    EXPECT_NEAR(placed->key[0].centre.z, 42, 3);
    PathologyRequest fluid = lesion("ascites", 40);
    fluid.host = {"other_fat"};
    const auto pool = phantom.place({fluid});
    ASSERT_TRUE(pool) << pool.error().message();
    EXPECT_NEAR(pool->key[0].volume_ml, 40, 0.004);  // a voxel
    double highest_fluid = -1e9, lowest_fat = 1e9;
    const Grid& grid = pool->volume.grid;
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const std::uint8_t label = pool->volume.voxels[grid.index(i, j, k)];
                if (label == 7) highest_fluid = std::max(highest_fluid, 1.0 * j);
                if (label == 1) lowest_fat = std::min(lowest_fat, 1.0 * j);
            }
    EXPECT_LE(highest_fluid, lowest_fat);
}

TEST(Pathology, AThrombusFillsItsShareOfAVessel) {
    Phantom phantom(1);
    PathologyRequest clot = lesion("thrombus", 0);
    clot.host = {"portal_vein"};
    clot.volume_ml = 0;
    clot.share = 0.5;
    clot.length_mm = 30;
    clot.centre = Point3{0, 5, 0};
    const auto placed = phantom.place({clot});
    ASSERT_TRUE(placed) << placed.error().message();
    const double lumen_ml = 45 * 29 / 1000.0;  // 45 voxels lie within 4 of one; the ends are round
    EXPECT_NEAR(placed->key[0].volume_ml, 0.5 * lumen_ml, 0.1);  // round ends, rows of voxels
    EXPECT_LT(placed->key[0].centre.y, 5);
}

TEST(Pathology, MassEffectKeepsTheVesselsVolume) {
    Phantom phantom(1.5);
    PathologyRequest request = lesion("hcc", 14);
    request.centre = Point3{0, -14, 0};
    request.mass_effect = 0.8;
    const auto placed = phantom.place({request});
    ASSERT_TRUE(placed) << placed.error().message();
    EXPECT_NEAR(placed->key[0].volume_ml, 14, 0.01);
    const auto before = static_cast<double>(count_label(phantom.volume, 3));
    const auto after = static_cast<double>(count_label(placed->volume, 3));
    EXPECT_NEAR(after / before, 1, 0.1);  // it runs along the lesion, where tissue is pressed most
    EXPECT_EQ(count_label(placed->volume, 5), count_label(phantom.volume, 5));  // bone stays
}

TEST(Pathology, EveryKindCanBePlacedWithTheSameBytesOnAnyNumberOfThreads) {
    HardCase other("voxels of any kind of lesion, other on one thread", HardCase::at_most, 0, "");
    Phantom phantom(1.5);
    for (const PathologyKind& kind : pathology_kinds()) {
        PathologyRequest request = lesion(kind.name, 3);
        if (kind.shape == LesionShape::tube) {
            request.volume_ml = 0;
            request.diameter_mm = 4;
            request.path = {{-20, -10, 0}, {0, -15, 5}, {20, -10, 0}};
        }
        if (kind.settles) request.host = {"gallbladder"};
        if (kind.name == "aneurysm") request.host = {"portal_vein"};
        const auto placed = phantom.place({request});
        ASSERT_TRUE(placed) << kind.name << ": " << placed.error().message();
        EXPECT_GT(placed->key[0].volume_ml, 0.1) << kind.name;
        // The same bytes on one thread, surfaces within voxels included.
        const ThreadLimit one(1);
        const auto single = phantom.place({request});
        ASSERT_TRUE(single) << kind.name;
        double differ = 0;
        for (std::size_t v = 0; v < placed->volume.voxels.size(); ++v)
            differ += placed->volume.voxels[v] != single->volume.voxels[v];
        other.see(differ);
        EXPECT_EQ(dense_from_bricks(placed->boundary), dense_from_bricks(single->boundary));
        EXPECT_EQ(placed->key[0].digest, single->key[0].digest) << kind.name;
    }
}

TEST(Pathology, RefusesWhatCannotBe) {
    Phantom phantom;
    EXPECT_NE(refusal(phantom, {lesion("hcc", 500)}).find("larger than its host"),
              std::string::npos);
    PathologyRequest tight = lesion("hcc", 60);
    tight.capsule_mm = 25;
    const std::string said = refusal(phantom, {tight});
    const std::string words = "the largest that fits has ";
    ASSERT_NE(said.find(words), std::string::npos) << said;
    // It fits, and one a little larger does not.
    HardCase largest("largest lesion that fits, over the one that is said to", HardCase::at_most,
                     1.1, "");
    const double said_ml = std::atof(said.c_str() + said.find(words) + words.size());
    double fits = 0;
    for (const double share : {0.99, 1.05, 1.1, 1.2, 1.5}) {
        tight.volume_ml = share * said_ml;
        if (phantom.place({tight})) fits = share;
    }
    EXPECT_GT(fits, 0) << said;
    largest.see(fits);
    PathologyRequest air = lesion("gallstone", 1);
    air.host = {"lung"};
    EXPECT_NE(refusal(phantom, {air}).find("is air"), std::string::npos);
    PathologyRequest typo = lesion("hcc", 1);
    typo.host = {"lever"};
    EXPECT_NE(refusal(phantom, {typo}).find("did you mean 'liver'"), std::string::npos);
    PathologyRequest a = lesion("hcc", 4), b = lesion("hcc", 4);
    a.centre = b.centre = Point3{0, -20, -12};
    b.name = "b";
    EXPECT_NE(refusal(phantom, {a, b}).find("overlaps 'it'"), std::string::npos);
    PathologyRequest lost = lesion("hcc", 1);
    lost.centre = Point3{0, 0, 70};
    EXPECT_NE(refusal(phantom, {lost}).find("lies in 'other_fat'"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
