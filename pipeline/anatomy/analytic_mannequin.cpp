// SPDX-License-Identifier: Apache-2.0

// The part of analytic_torso.h that makes the mannequin: its readings, mesh and landmarks.
#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/torso/trunk.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Not std::normal_distribution, whose sequence differs between standard libraries.
class Gaussian {
  public:
    explicit Gaussian(std::uint64_t seed) : engine_(seed) {}
    double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double operator()() {
        const double u = 1 - uniform(), v = uniform();
        return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
    }

  private:
    std::mt19937_64 engine_;
};

}  // namespace

Surface analytic_torso_mannequin(const AnalyticMannequinOptions& options,
                                 const AnalyticBody& body) {
    const Registration truth = analytic_torso_truth(options.strength, body);
    const double low = -kTorsoHalfHeight_mm - 30, high = kTorsoHalfHeight_mm + 30;
    const auto skin_point = [&](double theta, double z) {
        const Point3 p = trunk_point(theta, z, 0, body.belly_mm);
        return mannequin_from_ct(truth, {p.x * body.width_scale, p.y * body.depth_scale, p.z});
    };
    Surface out;
    if (options.mesh) {
        // Nearly square cells: the trunk has a circumference of 800 mm and is 370 mm tall.
        const int columns =
            std::max(12, static_cast<int>(std::lround(std::sqrt(options.points * 800.0 / 370.0))));
        const int rows = std::max(6, options.points / columns);
        for (int r = 0; r < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                out.points.push_back(
                    skin_point(2 * kPi * c / columns, low + (high - low) * r / (rows - 1)));
            }
        }
        for (int r = 0; r + 1 < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                const auto at = [&](int row, int column) {
                    return static_cast<std::uint32_t>(row * columns + column % columns);
                };
                out.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
                out.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
            }
        }
        return out;
    }
    Gaussian gaussian(options.seed);
    while (static_cast<int>(out.points.size()) < options.points) {
        const double theta = 2 * kPi * gaussian.uniform();
        const double z = low + (high - low) * gaussian.uniform();
        if (options.front_only && std::sin(theta) < -0.3) continue;
        const Point3 p = skin_point(theta, z);
        const double nx = gaussian(), ny = gaussian(), nz = gaussian();
        out.points.push_back(p + options.noise_mm * Vector3{nx, ny, nz});
    }
    return out;
}

std::vector<AnalyticLandmark> analytic_torso_landmarks(int count,
                                                       double noise_mm,
                                                       const AnalyticMannequinOptions& options,
                                                       const AnalyticBody& body) {
    const struct {
        const char* name;
        double theta, z;  // direction from the axis, 0 right, pi/2 front; height, mm
    } places[] = {{"navel", 0.5 * kPi, -40},
                  {"xiphoid", 0.5 * kPi, 105},
                  {"spinous_process_L4", 1.5 * kPi, -80},
                  {"hip_bone_right", 0.12 * kPi, -105},
                  {"hip_bone_left", 0.88 * kPi, -105},
                  {"costal_margin_right", 0.2 * kPi, 35},
                  {"costal_margin_left", 0.8 * kPi, 35},
                  {"spinous_process_T10", 1.5 * kPi, 120},
                  {"pubis", 0.5 * kPi, -145},
                  {"rib_9_right", 0, 90},
                  {"rib_9_left", kPi, 90},
                  {"loin_right", 1.72 * kPi, -20},
                  {"loin_left", 1.28 * kPi, -20},
                  {"sacrum", 1.5 * kPi, -145}};
    const Registration truth = analytic_torso_truth(options.strength, body);
    Gaussian noise(options.seed + 1000);
    std::vector<AnalyticLandmark> marks;
    for (const auto& place : places) {
        if (static_cast<int>(marks.size()) >= count) break;
        const Point3 p = trunk_point(place.theta, place.z, 0, body.belly_mm);
        const Point3 ct{p.x * body.width_scale, p.y * body.depth_scale, p.z};
        const double nx = noise(), ny = noise(), nz = noise();
        marks.push_back(
            {place.name, ct, mannequin_from_ct(truth, ct) + noise_mm * Vector3{nx, ny, nz}});
    }
    return marks;
}

}  // namespace sonocase::pipeline
