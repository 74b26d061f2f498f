// SPDX-License-Identifier: Apache-2.0

// The parts of the elastic warp: slopes against the B-spline itself, the transpose against its
// definition, the energy against closed forms and its own differences.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "pipeline/registration/elastic/elastic_rows.h"
#include "pipeline/registration/elastic/elastic_strain.h"
#include "pipeline/registration/elastic/organ_change.h"
#include "pipeline/registration/elastic/spline_lattice.h"
#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

using sonocase::testing::Random;

DisplacementGrid some_grid() {
    DisplacementGrid grid;
    grid.size = {7, 6, 8};
    grid.origin_mm = {-60, -45, -75};
    grid.spacing_mm = 30;
    return grid;
}

std::vector<Lanes> random_field(std::size_t count, Random& random, double size) {
    std::vector<Lanes> field(count);
    for (Lanes& c : field) {
        for (int r = 0; r < 3; ++r) c[r] = static_cast<float>(size * random.gaussian());
        c[3] = 0;
    }
    return field;
}

double dot_of(const Lanes& a, const Lanes& b) {
    double sum = 0;
    for (int r = 0; r < 3; ++r) sum += static_cast<double>(a[r]) * static_cast<double>(b[r]);
    return sum;
}

TEST(NaturalLog, AgreesWithLibmToTheLastDigitOrTwo) {
    for (double x = 1e-12; x < 1e12; x *= 1.0137) {
        const double exact = std::log(x);
        EXPECT_NEAR(natural_log(x), exact, 5e-16 * (1 + std::abs(exact))) << x;
    }
    EXPECT_EQ(natural_log(1), 0);
}

TEST(SplineLattice, SlopesAreThoseOfTheDisplacement) {
    DisplacementGrid grid = some_grid();
    const SplineLattice lattice(grid);
    Random random(1);
    const std::vector<Lanes> control = random_field(lattice.control_count(), random, 5);
    for (const Lanes& c : control) {
        grid.control_mm.push_back(
            {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])});
    }
    LatticeSlopes slopes;
    lattice.slopes(control, slopes);
    const Int3 size = lattice.size();
    EXPECT_EQ(size, (Int3{10, 8, 12}));
    std::size_t n = 0;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i, ++n) {
                const Matrix3 m = displacement_jacobian(grid, lattice.place(i, j, k));
                for (int r = 0; r < 3; ++r) {
                    // Single precision of values of about 5 / 30.
                    EXPECT_NEAR(static_cast<double>(slopes.x[n][r]), m(r, 0), 2e-6);
                    EXPECT_NEAR(static_cast<double>(slopes.y[n][r]), m(r, 1), 2e-6);
                    EXPECT_NEAR(static_cast<double>(slopes.z[n][r]), m(r, 2), 2e-6);
                }
            }
        }
    }
}

TEST(SplineLattice, TheTransposeIsOne) {
    const SplineLattice lattice(some_grid());
    Random random(2);
    const std::vector<Lanes> x = random_field(lattice.control_count(), random, 1);
    LatticeSlopes ax, y;
    lattice.slopes(x, ax);
    y.x = random_field(lattice.count(), random, 1);
    y.y = random_field(lattice.count(), random, 1);
    y.z = random_field(lattice.count(), random, 1);
    std::vector<Lanes> aty(x.size());
    lattice.transposed(y, false, aty);
    double left = 0, right = 0, size = 0;
    for (std::size_t i = 0; i < y.x.size(); ++i) {
        left += dot_of(ax.x[i], y.x[i]) + dot_of(ax.y[i], y.y[i]) + dot_of(ax.z[i], y.z[i]);
        size += dot_of(ax.x[i], ax.x[i]);
    }
    for (std::size_t i = 0; i < x.size(); ++i) right += dot_of(x[i], aty[i]);
    HardCase off("transpose against its definition, relative", HardCase::at_most, 1e-5, "");
    off.see(std::abs(left - right) / std::sqrt(size * static_cast<double>(y.x.size())));
    // squared: entry i is the sum of squared slopes of spline i times the values given.
    LatticeSlopes ones = y;
    for (auto* list : {&ones.x, &ones.y, &ones.z}) list->assign(lattice.count(), Lanes{1, 1, 1, 1});
    std::vector<Lanes> diagonal(x.size());
    lattice.transposed(ones, true, diagonal);
    for (const std::size_t i : {std::size_t{0}, x.size() / 2, x.size() - 1}) {
        std::vector<Lanes> unit(x.size(), Lanes{0, 0, 0, 0});
        unit[i] = Lanes{1, 0, 0, 0};
        lattice.slopes(unit, ax);
        double sum = 0;
        for (std::size_t n = 0; n < ax.x.size(); ++n) {
            sum += dot_of(ax.x[n], ax.x[n]) + dot_of(ax.y[n], ax.y[n]) + dot_of(ax.z[n], ax.z[n]);
        }
        EXPECT_NEAR(static_cast<double>(diagonal[i][0]), sum, 1e-5 * sum);
    }
}

QuadraticMap affine(const Matrix3& a) {
    QuadraticMap map;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c)
            map.coefficients[r][c + 1] = a(static_cast<int>(r), static_cast<int>(c));
    }
    return map;
}

TissueLattice one_tissue(const SplineLattice& lattice, float shape, float volume) {
    TissueLattice tissue;
    tissue.shape.assign(lattice.count(), shape);
    tissue.volume.assign(lattice.count(), volume);
    tissue.inside = static_cast<double>(lattice.count());
    return tissue;
}

ElasticStrain::Value still(const ElasticStrain& strain,
                           const SplineLattice& lattice,
                           const StrainOptions& options = {}) {
    LatticeSlopes none;
    none.resize(lattice.count());
    return strain.value(none, none, 0, options);
}

TEST(ElasticStrain, ATurnCostsNothingAndAScalingWhatTheFormulaSays) {
    const SplineLattice lattice(some_grid());
    Random random(3);
    for (const double s : {0.5, 0.8, 1.0, 1.3}) {
        Matrix3 scaled = random.rotation();
        for (double& m : scaled.m) m *= s;
        const ElasticStrain strain(lattice, affine(scaled), one_tissue(lattice, 7, 5));
        const double log_det = 3 * std::log(s), det = s * s * s;
        double expected = 7 * 3 * (s - 1) * (s - 1) + 5 * log_det * log_det;
        if (det < 0.6) expected += 30 * std::pow(std::log(det / 0.6), 2);
        const ElasticStrain::Value value = still(strain, lattice);
        EXPECT_NEAR(value.energy_mm2, expected, 1e-5 * (1 + expected)) << s;
        EXPECT_NEAR(value.min_det, det, 1e-6);
    }
}

TEST(ElasticStrain, TheGradientIsTheLimitOfDifferences) {
    const SplineLattice lattice(some_grid());
    Random random(4);
    ElasticStrain strain(lattice, affine(random.rotation()), one_tissue(lattice, 7, 5));
    const StrainOptions options{2, 30, 0.9};
    LatticeSlopes at, along, gradient;
    lattice.slopes(random_field(lattice.control_count(), random, 2), at);
    const std::vector<Lanes> p = random_field(lattice.control_count(), random, 2);
    lattice.slopes(p, along);
    strain.linearise(at, options, &gradient);
    std::vector<Lanes> g(lattice.control_count());
    lattice.transposed(gradient, false, g);
    double slope = 0;
    for (std::size_t i = 0; i < p.size(); ++i) slope += 2 * dot_of(p[i], g[i]);
    const auto difference = [&](double t) {
        return (strain.value(at, along, t, options).energy_mm2 -
                strain.value(at, along, -t, options).energy_mm2) /
               (2 * t);
    };
    // The truncation error is of order t^2; below this step single precision limits it.
    HardCase off("gradient against differences, relative", HardCase::at_most, 1e-3, "");
    off.see(std::abs(difference(0.02) / slope - 1));
}

TEST(ElasticStrain, TheCurvatureIsPositive) {
    const SplineLattice lattice(some_grid());
    Random random(5);
    ElasticStrain strain(lattice, affine(random.rotation()), one_tissue(lattice, 7, 5));
    LatticeSlopes at, along, gradient, bent;
    lattice.slopes(random_field(lattice.control_count(), random, 3), at);
    strain.linearise(at, {}, &gradient);
    for (int n = 0; n < 20; ++n) {
        lattice.slopes(random_field(lattice.control_count(), random, 1), along);
        bent = along;
        strain.apply_curvature(&bent);
        double sum = 0;
        for (std::size_t i = 0; i < bent.x.size(); ++i) {
            sum += dot_of(along.x[i], bent.x[i]) + dot_of(along.y[i], bent.y[i]) +
                   dot_of(along.z[i], bent.z[i]);
        }
        EXPECT_GT(sum, 0);
    }
}

TEST(OrganChanges, AnAffineMapChangesEveryOrganByItsDeterminant) {
    LabelVolume labels;
    labels.grid.size = {20, 20, 20};
    labels.grid.spacing_mm = {3, 3, 3};
    labels.labels = {{"outside", "outside"}, {"liver", "liver"}, {"hip_left", "bone"}};
    for (std::size_t n = 0; n < labels.grid.voxel_count(); ++n)
        labels.voxels.push_back(static_cast<std::uint8_t>(n % 20 < 15 ? 1 : n % 20 < 16 ? 2 : 0));
    Random random(6);
    Registration map;
    map.ct_box.include(Point3{-5, -5, -5});
    map.ct_box.include(Point3{65, 65, 65});
    map.quadratic = affine(random.rotation() * Matrix3::diagonal({1.2, 0.9, 1}));
    const std::vector<OrganChange> changes = organ_changes(labels, map);
    ASSERT_EQ(changes.size(), 2u);
    for (const OrganChange& c : changes) {
        EXPECT_NEAR(c.volume_ratio, 1.08, 1e-9);
        EXPECT_NEAR(c.shape_change, 0.2, 1e-9);
    }
    EXPECT_NEAR(changes[0].before_ml, 15 * 400 * 0.027, 1e-9);
    EXPECT_EQ(changes[1].label, "hip_left");
}

TEST(RimPatches, ACylinderGoesOnBeyondItsLastReading) {
    // Readings on the front half of a cylinder of 130 mm: the patch of the last row must follow the
    // skin 20 mm round the flank, where the tangent plane is 1.5 to 3 mm off.
    Surface readings;
    Random random(7);
    for (int n = 0; n < 1500; ++n) {
        const double angle = random.uniform(0, kPi), z = random.uniform(-150, 150);
        readings.points.push_back({130 * std::cos(angle), 130 * std::sin(angle), z});
    }
    const auto target = prepare_target(readings);
    ASSERT_TRUE(target);
    std::vector<std::uint32_t> all;
    for (std::uint32_t i = 0; i < target->points.size(); ++i) all.push_back(i);
    const RimPatches patches(*target, all);
    int found = 0;
    HardCase beyond_mm("skin 20 mm beyond the last reading", HardCase::at_most, 0.9, "mm");
    for (double z = -100; z <= 100; z += 20) {
        for (const double side : {1.0, -1.0}) {
            const double angle = -20.0 / 130;
            const Point3 beyond = Point3{side * 130 * std::cos(angle), 130 * std::sin(angle), z} -
                                  (target->origin - Point3{});
            const auto nearest = patches.nearest_point(target->index.nearest(beyond), beyond);
            found += nearest.found;
            // The readings nearest to the edge lie up to 10 mm inside it.
            if (nearest.found) beyond_mm.see(std::abs(nearest.gap_mm));
        }
    }
    EXPECT_GE(found, 16);  // of 22: some nearest readings are inside the rim
}

}  // namespace
}  // namespace sonocase::pipeline
