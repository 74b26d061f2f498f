// SPDX-License-Identifier: Apache-2.0

// How the answers of stages become bytes in the cache and come back. Seconds are left out, so that
// the same inputs give the same bytes and a later stage's key changes only where the answer did.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/stage_files.h"
#include "formats/registration/registration.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline {

using Bytes = std::vector<std::uint8_t>;

struct LabelCodec {
    using Value = LabelFile;
    static Bytes encode(const LabelFile& file);
    static Result<LabelFile> decode(const Bytes& bytes, const std::string& where);
    static const std::vector<StageReport>& reports(const LabelFile& file) { return file.reports; }
};

struct SkinCodec {
    using Value = SkinSurfaceResult;
    static Bytes encode(const SkinSurfaceResult& skin);
    static Result<SkinSurfaceResult> decode(const Bytes& bytes, const std::string& where);
    static std::vector<StageReport> reports(const SkinSurfaceResult& skin) { return {skin.report}; }
};

struct TextureCodec {
    using Value = TextureFile;
    static Bytes encode(const TextureFile& file);
    static Result<TextureFile> decode(const Bytes& bytes, const std::string& where);
    static const std::vector<StageReport>& reports(const TextureFile& file) { return file.reports; }
};

struct RegistrationCodec {
    using Value = Registration;
    static Bytes encode(const Registration& registration);
    static Result<Registration> decode(const Bytes& bytes, const std::string& where);
    static const std::vector<StageReport>& reports(const Registration& registration) {
        return registration.reports;
    }
};

// Echo offsets alone, without the labels that they belong to.
struct EchoOffsets {
    BrickVolume<std::int8_t> offset;
    std::vector<StageReport> reports;
};

struct EchoCodec {
    using Value = EchoOffsets;
    static Bytes encode(const EchoOffsets& offsets);
    static Result<EchoOffsets> decode(const Bytes& bytes, const std::string& where);
    static const std::vector<StageReport>& reports(const EchoOffsets& offsets) {
        return offsets.reports;
    }
};

}  // namespace sonocase::pipeline
