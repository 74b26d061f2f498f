// SPDX-License-Identifier: Apache-2.0

// The 3-D view of a page: the meshes that the desktop draws, and from where. The page draws them
// itself (page/view3d.js).
#pragma once

#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/display/models/camera.h"
#include "runtime/display/models/skin_mesh.h"
#include "runtime/display/models/tool_models.h"
#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime::inline web {

// Meshes that every case has; the organs follow, as many as there are.
enum class ScenePart : int { skin, probe, mark, plane, needle, hub, ball, count };

class PageScene {
  public:
    // The skin of a case, so that there is something to see at once. Cost: see skin_mesh.h.
    void begin(const CaseBundle& bundle);
    // Then its organs, which take longer.
    void add_organs(const CaseBundle& bundle);
    void end() { *this = {}; }
    bool begun() const { return begun_; }
    int parts() const {
        return static_cast<int>(ScenePart::count) + static_cast<int>(organs_.size());
    }

    // A part of the scene, its frame that of the tool or `mannequin`. part: from 0 to parts() - 1.
    Model part(int part, const ScanEngine& engine, const PlanePicture& picture) const;
    unsigned rgb(int part) const;  // of organs

    // mannequin_from_camera: from outside where the tool is not there.
    Rigid camera(ViewFrom from, const Orbit& orbit, const ScanEngine& engine) const;
    // The first view from outside.
    Orbit first(const ScanEngine& engine) const;

  private:
    bool begun_ = false;
    Surface skin_;
    Box3 body_;
    std::vector<OrganMesh> organs_;
};

}  // namespace sonocase::runtime::inline web
