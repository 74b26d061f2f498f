// SPDX-License-Identifier: Apache-2.0

// Scans and sweeps denser than a fit can use.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "formats/text/number_text.h"
#include "pipeline/import/mesh/surface_file.h"
#include "support/hard_case.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

using sonocase::testing::Random;
using sonocase::testing::TemporaryFolder;

constexpr double kA = 170, kB = 110, kC = 260;  // half axes of the body, mm

Point3 on_body(double u, double v) {
    return {kA * std::sin(v) * std::cos(u), kB * std::sin(v) * std::sin(u), kC * std::cos(v)};
}

// Distance from the ellipsoid, first order.
double off_body_mm(Point3 p) {
    const double x = p.x / kA, y = p.y / kB, z = p.z / kC;
    const double f = x * x + y * y + z * z - 1;
    return 0.5 * f / std::sqrt(x * x / (kA * kA) + y * y / (kB * kB) + z * z / (kC * kC));
}

// n x n vertices; 2 n^2 triangles.
Surface dense_body(int n, double noise_mm) {
    Random random(1);
    Surface s;
    for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
            s.points.push_back(
                on_body(6.283185307179586 * i / n, 0.02 + 3.1015926535 * j / (n - 1)) +
                noise_mm * Vector3{random.gaussian(), random.gaussian(), random.gaussian()});
        }
    }
    const auto at = [n](int i, int j) { return static_cast<std::uint32_t>(i % n + n * j); };
    for (int j = 0; j + 1 < n; ++j) {
        for (int i = 0; i < n; ++i) {
            s.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            s.triangles.push_back({at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
        }
    }
    return s;
}

void add_speck(Surface& s, Point3 place) {
    const auto n = static_cast<std::uint32_t>(s.points.size());
    for (const Vector3 d : {Vector3{0, 0, 0}, Vector3{9, 0, 0}, Vector3{0, 9, 0}})
        s.points.push_back(place + d);
    s.triangles.push_back({n, n + 1, n + 2});
}

void write_ply(const Surface& s, double scale, const std::string& path) {
    std::ofstream out(path, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << s.points.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
        << s.triangles.size() << "\nproperty list uchar uint vertex_indices\nend_header\n";
    for (const Point3 p : s.points) {
        const float v[3] = {static_cast<float>(scale * p.x), static_cast<float>(scale * p.y),
                            static_cast<float>(scale * p.z)};
        out.write(reinterpret_cast<const char*>(v), sizeof v);
    }
    for (const auto& t : s.triangles) {
        out.put(3);
        out.write(reinterpret_cast<const char*>(t.data()), sizeof t);
    }
}

void write_stl(const Surface& s, const std::string& path) {
    std::ofstream out(path, std::ios::binary);
    out << std::string(80, ' ');
    const auto count = static_cast<std::uint32_t>(s.triangles.size());
    out.write(reinterpret_cast<const char*>(&count), sizeof count);
    for (const auto& t : s.triangles) {
        float v[12] = {};
        for (std::size_t c = 0; c < 3; ++c) {
            const Point3 p = s.points[t[c]];
            v[3 + 3 * c] = static_cast<float>(p.x);
            v[4 + 3 * c] = static_cast<float>(p.y);
            v[5 + 3 * c] = static_cast<float>(p.z);
        }
        out.write(reinterpret_cast<const char*>(v), sizeof v);
        out.write("\0", 2);
    }
}

double measure(const StageReport& report, const std::string& name) {
    for (const Measure& m : report.measures) {
        if (m.name == name) return m.value;
    }
    return -1;
}

double rms_off_body_mm(const Surface& s) {
    double sum = 0;
    for (const Point3 p : s.points) {
        const double d = off_body_mm(p);
        sum += d * d / static_cast<double>(s.points.size());
    }
    return std::sqrt(sum);
}

double outward_share(const Surface& s) {
    double out = 0;
    for (std::size_t i = 0; i < s.points.size(); ++i)
        out += dot(s.normals[i], s.points[i] - Point3{}) > 0;
    return out / static_cast<double>(s.points.size());
}

TEST(DenseSurface, AMeshIsReducedWithItsErrorSaidAndItsSpecksCounted) {
    const TemporaryFolder folder;
    Surface body = dense_body(480, 0);
    for (int n = 0; n < 7; ++n) add_speck(body, {250.0 + 20 * n, 0, 0});
    write_ply(body, 1, folder / "body.ply");
    write_stl(body, folder / "body.stl");
    write_ply(body, 0.001, folder / "metres.ply");
    for (const std::string name : {"body.ply", "body.stl", "metres.ply"}) {
        SCOPED_TRACE(name);
        StageReport report;
        const auto s =
            import_surface(folder / name, {name == "metres.ply" ? 1000.0 : 1.0}, &report);
        ASSERT_TRUE(s) << s.error().message();
        // 0.42 m^2 in squares of 4 mm make 26,000 vertices, and more where cubes are cut askew.
        EXPECT_LT(s->points.size(), 60000u);
        EXPECT_GT(s->points.size(), 20000u);
        EXPECT_EQ(measure(report, "given_triangles"), static_cast<double>(body.triangles.size()));
        EXPECT_EQ(measure(report, "small_parts"), 7);
        // 4^2 / (24 R) on the flat side and ten times that at the tips, where R is 40 mm.
        EXPECT_LT(rms_off_body_mm(*s), 0.05);
        // The specks were given as well, and have been removed.
        EXPECT_LT(measure(report, "reduction_rms_mm"), 0.1);
        EXPECT_GT(outward_share(*s), 0.999);
        for (const std::string& w : report.warnings)
            EXPECT_EQ(w.find("faced inwards"), std::string::npos) << w;
    }
}

TEST(DenseSurface, AMillionPartsLeaveTheBody) {
    const TemporaryFolder folder(/*in_memory=*/true);
    Surface body = dense_body(480, 0);
    constexpr int kParts = 1000000;
    for (int n = 0; n < kParts; ++n) {
        const int i = n % 100, j = n / 100 % 100, k = n / 10000;
        const Point3 p{300 + 0.5 * i, 0.5 * j, 0.5 * k};
        const auto first = static_cast<std::uint32_t>(body.points.size());
        for (const Vector3 d : {Vector3{0, 0, 0}, Vector3{0.3, 0, 0}, Vector3{0, 0.3, 0}})
            body.points.push_back(p + d);
        body.triangles.push_back({first, first + 1, first + 2});
    }
    write_stl(body, folder / "body.stl");
    StageReport report;
    const auto s = import_surface(folder / "body.stl", {}, &report);
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_EQ(measure(report, "given_triangles"), static_cast<double>(body.triangles.size()));
    EXPECT_LT(rms_off_body_mm(*s), 0.05);
}

TEST(DenseSurface, ANoisyMeshWithASecondLayerIsStillTheBody) {
    const TemporaryFolder folder;
    Surface body = dense_body(480, 0.3);
    const std::size_t points = body.points.size(), triangles = body.triangles.size();
    for (std::size_t i = 0; i < points; ++i) body.points.push_back(body.points[i]);
    for (std::size_t t = 0; t < triangles; ++t) {
        auto twice = body.triangles[t];
        for (std::uint32_t& v : twice) v += static_cast<std::uint32_t>(points);
        body.triangles.push_back(twice);
    }
    write_ply(body, 1, folder / "twice.ply");
    StageReport report;
    const auto s = import_surface(folder / "twice.ply", {}, &report);
    ASSERT_TRUE(s) << s.error().message();
    // Eight vertices to a cube: 0.3 mm of noise over root 4 (each is there twice).
    HardCase off("vertices off the body, .3 mm of noise and two layers, rms", HardCase::at_most,
                 0.2, "mm");
    off.see(rms_off_body_mm(*s));
    EXPECT_GT(outward_share(*s), 0.99);
    EXPECT_LT(measure(report, "reduction_rms_mm"), 0.5);
}

// The same file twice gives the same surface.
TEST(DenseSurface, IsTheSameEveryTime) {
    const TemporaryFolder folder;
    write_ply(dense_body(460, 0.2), 1, folder / "body.ply");
    const auto a = import_surface(folder / "body.ply"), b = import_surface(folder / "body.ply");
    ASSERT_TRUE(a && b);
    EXPECT_EQ(a->points, b->points);
    EXPECT_EQ(a->triangles, b->triangles);
}

TEST(DenseSurface, AMillionReadingsKeepTheSkinAndLoseThoseInTheAir) {
    const TemporaryFolder folder;
    Random random(2);
    std::string csv = "x,y,z\n";
    const int count = 250000;
    for (int n = 0; n < count; ++n) {
        const Vector3 d = random.direction();
        Point3 p{kA * d.x, kB * d.y, kC * d.z};
        p = p + 0.7 * Vector3{random.gaussian(), random.gaussian(), random.gaussian()};
        if (n % 100 == 0) p = p + random.uniform(12, 60) * d;
        csv += number_text(p.x) + "," + number_text(p.y) + "," + number_text(p.z) + "\n";
    }
    folder.write("sweep.csv", csv);
    StageReport report;
    const auto s = import_surface(folder / "sweep.csv", {}, &report);
    ASSERT_TRUE(s) << s.error().message();
    EXPECT_EQ(measure(report, "given_points"), count);
    EXPECT_LT(s->points.size(), 40000u);
    // 90 % of the 2,500 readings in the air are alone in their cubes, beside full ones.
    EXPECT_GT(measure(report, "sparse_points"), 1500);
    const auto far = std::count_if(s->points.begin(), s->points.end(),
                                   [](Point3 p) { return std::abs(off_body_mm(p)) > 8; });
    HardCase left("share of points in the air that stay, of all", HardCase::at_most, 0.03, "");
    left.see(static_cast<double>(far) / static_cast<double>(s->points.size()));
}

TEST(DenseSurface, AnOrdinarySweepIsLeftAlone) {
    const TemporaryFolder folder;
    Random random(3);
    std::string csv = "x,y,z\n";
    for (int n = 0; n < 20000; ++n) {
        const Vector3 d = random.direction();
        csv += number_text(kA * d.x) + "," + number_text(kB * d.y) + "," + number_text(kC * d.z) +
               "\n";
    }
    folder.write("sweep.csv", csv);
    StageReport report;
    const auto s = import_surface(folder / "sweep.csv", {}, &report);
    ASSERT_TRUE(s);
    EXPECT_EQ(s->points.size(), 20000u);
    EXPECT_EQ(measure(report, "given_points"), -1);
}

}  // namespace
}  // namespace sonocase::pipeline
