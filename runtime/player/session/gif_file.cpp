// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/gif_file.h"

#include <gif_lib.h>

#include <cassert>
#include <memory>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime::inline player_session {
namespace {

int keep_bytes(GifFileType* gif, const GifByteType* bytes, int count) {
    auto& out = *static_cast<std::vector<std::uint8_t>*>(gif->UserData);
    out.insert(out.end(), bytes, bytes + count);
    return count;
}

// The film starts over at its end, for ever (the extension that Netscape introduced).
bool put_loop(GifFileType* gif) {
    constexpr unsigned char kTimes[] = {1, 0, 0};
    return EGifPutExtensionLeader(gif, APPLICATION_EXT_FUNC_CODE) == GIF_OK &&
           EGifPutExtensionBlock(gif, 11, "NETSCAPE2.0") == GIF_OK &&
           EGifPutExtensionBlock(gif, sizeof kTimes, kTimes) == GIF_OK &&
           EGifPutExtensionTrailer(gif) == GIF_OK;
}

bool put_frame(GifFileType* gif,
               int width,
               int height,
               const std::vector<std::uint8_t>& pixels,
               int delay_cs) {
    GraphicsControlBlock control{};
    control.DisposalMode = DISPOSE_DO_NOT;
    control.DelayTime = delay_cs;
    control.TransparentColor = NO_TRANSPARENT_COLOR;
    GifByteType bytes[4];
    EGifGCBToExtension(&control, bytes);
    if (EGifPutExtension(gif, GRAPHICS_EXT_FUNC_CODE, sizeof bytes, bytes) != GIF_OK ||
        EGifPutImageDesc(gif, 0, 0, width, height, false, nullptr) != GIF_OK)
        return false;
    for (int y = 0; y < height; ++y) {
        auto* row = const_cast<GifPixelType*>(pixels.data()) + static_cast<std::size_t>(y) * width;
        if (EGifPutLine(gif, row, width) != GIF_OK) return false;
    }
    return true;
}

}  // namespace

Status write_gif(const std::string& path,
                 int width,
                 int height,
                 const GifColours& colours,
                 const std::vector<std::vector<std::uint8_t>>& frames,
                 const std::vector<int>& delays_cs) {
    assert(!frames.empty() && frames.size() == delays_cs.size());
    std::vector<std::uint8_t> bytes;
    int fault = 0;
    GifFileType* gif = EGifOpen(&bytes, keep_bytes, &fault);
    if (!gif) return Error{"the film cannot be made", path, ""};
    GifColorType entries[256];
    for (std::size_t i = 0; i < colours.size(); ++i)
        entries[i] = {colours[i][0], colours[i][1], colours[i][2]};
    const std::unique_ptr<ColorMapObject, void (*)(ColorMapObject*)> map(
        GifMakeMapObject(256, entries), GifFreeMapObject);
    EGifSetGifVersion(gif, true);
    bool good =
        map && EGifPutScreenDesc(gif, width, height, 8, 0, map.get()) == GIF_OK && put_loop(gif);
    for (std::size_t i = 0; good && i < frames.size(); ++i) {
        assert(frames[i].size() == static_cast<std::size_t>(width) * height);
        good = put_frame(gif, width, height, frames[i], delays_cs[i]);
    }
    good = EGifCloseFile(gif, &fault) == GIF_OK && good;
    if (!good) return Error{"the film cannot be made", path, ""};
    return write_file(path, bytes);
}

}  // namespace sonocase::runtime::inline player_session
