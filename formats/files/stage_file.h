// SPDX-License-Identifier: Apache-2.0

// The files between stages on disk (formats/bundle/stage_files.h).
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/bundle/stage_files.h"

namespace sonocase {

Status save_label_file(const LabelFile& file, const std::string& path);
Result<LabelFile> load_label_file(const std::string& path);
Status save_texture_file(const TextureFile& file, const std::string& path);
Result<TextureFile> load_texture_file(const std::string& path);
Status save_surface_file(const SurfaceFile& file, const std::string& path);
Result<SurfaceFile> load_surface_file(const std::string& path);

}  // namespace sonocase
