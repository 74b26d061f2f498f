// SPDX-License-Identifier: Apache-2.0

#include "bench_bundle.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "formats/files/load_save.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/stages/read_recipe.h"
#include "support/paths.h"
#include "support/random.h"

namespace sonocase::bench {
namespace {

struct Loaded {
    CaseBundle bundle;
    std::string name;
};

Result<CaseBundle> cook(const Result<pipeline::Recipe>& recipe) {
    if (!recipe) return recipe.error();
    auto cooked = pipeline::cook_case(*recipe);
    if (!cooked) return cooked.error();
    return std::move(cooked->bundle);
}

Loaded make() {
    if (const char* path = std::getenv("SONOCASE_BENCH_BUNDLE")) {
        Result<CaseBundle> bundle = load_bundle(path);
        if (bundle) return {std::move(*bundle), path};
        std::fprintf(stderr, "%s\n", bundle.error().message().c_str());
        std::exit(1);
    }
    const std::string recipe = std::string(SONOCASE_SOURCE) + "/scenarios/real-torso/case.toml";
    if (std::filesystem::exists(recipe) && std::filesystem::exists(SONOCASE_DATA)) {
        pipeline::RecipeOverrides overrides;
        overrides.data = SONOCASE_DATA;
        Result<CaseBundle> bundle = cook(pipeline::load_recipe(recipe, overrides));
        if (bundle) return {std::move(*bundle), "real-torso"};
        std::fprintf(stderr, "real-torso: %s\n", bundle.error().message().c_str());
    }
    Result<CaseBundle> bundle = cook(pipeline::embedded_recipe());
    if (bundle) return {std::move(*bundle), "demo-torso"};
    std::fprintf(stderr, "%s\n", bundle.error().message().c_str());
    std::exit(1);
}

const Loaded& loaded() {
    static const Loaded one = make();
    return one;
}

}  // namespace

const CaseBundle& bench_bundle() {
    return loaded().bundle;
}
const std::string& bench_bundle_name() {
    return loaded().name;
}

const std::vector<Rigid>& bench_poses() {
    static const std::vector<Rigid> poses = [] {
        const CaseBundle& b = bench_bundle();
        const Point3 middle = b.grid.bounds().centre();
        sonocase::testing::Random random(42);
        std::vector<Rigid> out;
        while (out.size() < 61) {  // prime: cycles of other lengths never fall in step
            const Point3 aim = middle + Vector3{random.uniform(-60, 60), random.uniform(-60, 60),
                                                random.uniform(-40, 40)};
            const Vector3 beam = random.direction();
            // From outside along the beam to the first voxel of the body.
            for (double t = -400; t < 0; t += 0.5) {
                const Point3 p = aim + t * beam;
                const Point3 v = b.grid.voxel_from_point(p);
                const Int3 i{static_cast<int>(std::lround(v.x)), static_cast<int>(std::lround(v.y)),
                             static_cast<int>(std::lround(v.z))};
                if (!b.grid.contains(i.x, i.y, i.z) || b.label_bricks.at(i.x, i.y, i.z) == 0)
                    continue;
                const Vector3 x = normalized(cross(random.direction(), beam));
                out.push_back({Matrix3::from_columns(x, cross(beam, x), beam), {p.x, p.y, p.z}});
                break;
            }
        }
        return out;
    }();
    return poses;
}

}  // namespace sonocase::bench
