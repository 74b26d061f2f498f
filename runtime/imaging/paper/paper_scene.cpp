// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_scene.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_bundle.h"

namespace sonocase::runtime {
namespace {

const SolidTexture* find_texture(const CaseBundle& bundle, const std::string& name) {
    for (const SolidTexture& t : bundle.textures) {
        if (t.name == name && t.edge > 0 && t.voxel_mm > 0) return &t;
    }
    return nullptr;
}

// A tissue's cube of grey. A texture of another voxel size is resampled to the scene's, and one
// that does not fill the cube is repeated; in both cases its period divides the cube's edge.
void bake(const Tissue& tissue,
          const SolidTexture* texture,
          int edge,
          double voxel_mm,
          std::uint8_t* out) {
    std::array<std::uint8_t, 256> grey{};
    for (int v = 0; v < 256; ++v) {
        const double g = tissue.grey_mean + (v - 128) / 32.0 * tissue.grey_sd;
        grey[v] = static_cast<std::uint8_t>(std::lround(std::clamp(g, 0.0, 255.0)));
    }
    if (texture == nullptr) {
        std::fill_n(out, static_cast<std::size_t>(edge) * edge * edge, grey[128]);
        return;
    }
    int period = 1;
    while (period < edge && period * 1.4142 * voxel_mm < texture->edge * texture->voxel_mm)
        period *= 2;
    std::vector<std::size_t> source(edge);
    for (int i = 0; i < edge; ++i) {
        source[i] = (i % period) * texture->edge / period;
    }
    const std::size_t n = texture->edge;
    for (const std::size_t k : source) {
        for (const std::size_t j : source) {
            const std::uint8_t* row = texture->voxels.data() + n * (j + n * k);
            for (const std::size_t i : source) *out++ = grey[row[i]];
        }
    }
}

// Gives every draining lumen a material of its own, a copy of its tissue's, and notes what is shown
// of it when it is collapsed. In a bundle with too many materials such lumens keep the material of
// their tissue and stay open.
void add_closed_materials(const CaseBundle& bundle,
                          std::size_t cube,
                          std::array<std::uint8_t, 256>& material,
                          PaperScene& scene) {
    const std::vector<std::int32_t> shown = press::closed_labels(bundle);
    std::array<std::uint8_t, 256> wall = material;
    for (std::size_t l = 1; l < bundle.labels.size() && l < material.size(); ++l) {
        if (shown[l] == static_cast<std::int32_t>(l) || scene.flat_grey.size() > 127) continue;
        const std::size_t from = material[l] & ~PaperScene::kShadowBit;
        wall[l] = material[shown[l]];
        material[l] = static_cast<std::uint8_t>(scene.flat_grey.size() |
                                                (material[l] & PaperScene::kShadowBit));
        scene.atlas.resize(scene.atlas.size() + cube);
        std::copy_n(scene.atlas.begin() + static_cast<std::ptrdiff_t>(cube * from), cube,
                    scene.atlas.end() - static_cast<std::ptrdiff_t>(cube));
        scene.flat_grey.push_back(scene.flat_grey[from]);
    }
    scene.materials = static_cast<int>(scene.flat_grey.size());
    scene.atlas.resize(scene.atlas.size() + kGatherSlack);
    for (std::int32_t m = 0; m < 256; ++m) scene.closed_material.push_back(m);
    for (std::size_t l = 1; l < bundle.labels.size() && l < material.size(); ++l) {
        if (wall[l] != material[l]) scene.closed_material[material[l]] = wall[l];
    }
}

}  // namespace

Result<PaperScene> make_paper_scene(const CaseBundle& bundle) {
    PaperScene scene;
    scene.grid = bundle.grid;
    scene.bricks = brick_count(bundle.label_bricks.size);
    if (bundle.labels.empty() || bundle.label_bricks.table.empty()) {
        return Error{"the bundle holds no label volume", "", "build the case again"};
    }

    const std::vector<int> tissue_of = tissue_of_label(bundle);
    std::vector<bool> used(bundle.tissues.size(), false);
    for (std::size_t l = 1; l < tissue_of.size(); ++l) {
        if (tissue_of[l] >= 0) used[tissue_of[l]] = true;
    }
    // The largest edge and the finest voxel in use decide the cube.
    int edge = 0;
    double voxel_mm = 0;
    for (std::size_t t = 0; t < bundle.tissues.size(); ++t) {
        const SolidTexture* texture =
            used[t] ? find_texture(bundle, bundle.tissues[t].texture) : nullptr;
        if (texture == nullptr) continue;
        edge = std::max(edge, texture->edge);
        voxel_mm = voxel_mm > 0 ? std::min(voxel_mm, texture->voxel_mm) : texture->voxel_mm;
    }
    if (edge == 0) {
        edge = 8;
        voxel_mm = 0.5;
    }
    scene.texture_voxel_mm = voxel_mm;
    scene.edge_log2 = 0;
    while ((1 << scene.edge_log2) < edge) ++scene.edge_log2;
    edge = 1 << scene.edge_log2;
    const std::size_t cube = static_cast<std::size_t>(edge) * edge * edge;

    scene.atlas.assign(cube, 0);
    scene.flat_grey.assign(1, 0);
    std::vector<std::uint8_t> material_of_tissue(bundle.tissues.size(), 0);
    for (std::size_t t = 0; t < bundle.tissues.size(); ++t) {
        if (!used[t] || bundle.tissues[t].kind == TissueKind::outside) continue;
        const std::size_t index = scene.flat_grey.size();
        if (index > 127)
            return Error{"the bundle uses more than 127 tissues", "",
                         "merge tissues in the recipe"};
        const Tissue& tissue = bundle.tissues[t];
        scene.atlas.resize(cube * (index + 1));
        bake(tissue, find_texture(bundle, tissue.texture), edge, voxel_mm,
             scene.atlas.data() + cube * index);
        scene.flat_grey.push_back(
            static_cast<std::uint8_t>(std::lround(std::clamp(tissue.grey_mean, 0.0, 255.0))));
        material_of_tissue[t] =
            static_cast<std::uint8_t>(index | (tissue.casts_shadow ? PaperScene::kShadowBit : 0u));
        scene.has_shadow = scene.has_shadow || tissue.casts_shadow;
    }
    std::array<std::uint8_t, 256> material{};
    for (std::size_t l = 1; l < tissue_of.size() && l < material.size(); ++l) {
        if (tissue_of[l] >= 0) material[l] = material_of_tissue[tissue_of[l]];
    }
    add_closed_materials(bundle, cube, material, scene);
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    scene.table.resize(labels.table.size());
    for (std::size_t b = 0; b < labels.table.size(); ++b) {
        const std::uint32_t entry = labels.table[b];
        scene.table[b] = entry & kUniformBrick
                             ? kUniformBrick | material[labels.uniform[entry & ~kUniformBrick]]
                             : entry;
    }
    scene.pool.resize(labels.pool.size() + kGatherSlack);
    for (std::size_t i = 0; i < labels.pool.size(); ++i) scene.pool[i] = material[labels.pool[i]];
    return scene;
}

std::uint32_t material_at(const PaperScene& s, int i, int j, int k) {
    if (i < 0 || j < 0 || k < 0 || i >= s.grid.size.x || j >= s.grid.size.y || k >= s.grid.size.z)
        return 0;
    const std::size_t brick =
        i / kBrickEdge +
        s.bricks.x * (j / kBrickEdge + s.bricks.y * static_cast<std::size_t>(k / kBrickEdge));
    const std::uint32_t entry = s.table[brick];
    if (entry & kUniformBrick) return entry & 0xFFu;
    return s.pool[static_cast<std::size_t>(entry) * kBrickVoxels + (i % 4) + 4 * (j % 4) +
                  16 * (k % 4)];
}

}  // namespace sonocase::runtime
