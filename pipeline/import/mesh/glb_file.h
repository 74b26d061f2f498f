// SPDX-License-Identifier: Apache-2.0

// glTF 2.0 binary (GLB), read here because VTK's reader loses the names of the nodes.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"
#include "pipeline/base/source_checks.h"

namespace sonocase::pipeline::inline import_mesh {

struct MeshNode {
    std::string file;  // its name without folder
    std::string name;  // of the node; of a file without nodes, its stem
    Surface surface;   // points and triangles; node transforms applied
};

// Triangles of every node that has a mesh and is in the scene, in the file's own axes and units
// (metres, y up). aside: names of the nodes with a mesh that are not in it; may be null. Errors,
// one line each: not GLB; cut off; compressed (an extension is required); buffers in other files;
// primitives that are not triangles; indices or accessors beyond their buffer.
Result<std::vector<MeshNode>> read_glb(std::span<const std::uint8_t> bytes,
                                       const std::string& where,
                                       std::vector<std::string>* aside = nullptr);

// A point of a GLB in RAS+: y up is the head, z the front, x the patient's left. told: the file's
// x, y and z are the patient's axes instead.
Point3 ras_from_gltf(Point3 p, Axes told);
std::string gltf_axes_sentence(Axes told);  // for reports

}  // namespace sonocase::pipeline::inline import_mesh
