// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/detect/grey_jpeg.h"

#include <csetjmp>
#include <cstdio>

#include <dlfcn.h>
#include <jpeglib.h>

namespace sonocase {
namespace {

struct Library {
    decltype(&jpeg_std_error) std_error = nullptr;
    decltype(&jpeg_CreateDecompress) create = nullptr;
    decltype(&jpeg_mem_src) mem_src = nullptr;
    decltype(&jpeg_read_header) read_header = nullptr;
    decltype(&jpeg_start_decompress) start = nullptr;
    decltype(&jpeg_read_scanlines) read_scanlines = nullptr;
    decltype(&jpeg_abort_decompress) abort = nullptr;
    decltype(&jpeg_destroy_decompress) destroy = nullptr;
    bool complete = false;
};

template <class Function>
bool find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    return function != nullptr;
}

// Opened once, never closed.
const Library& library() {
    static const Library opened = [] {
        Library l;
        void* handle = dlopen("libjpeg.so.62", RTLD_NOW | RTLD_LOCAL);
        if (!handle) return l;
        l.complete = find(handle, "jpeg_std_error", l.std_error) &&
                     find(handle, "jpeg_CreateDecompress", l.create) &&
                     find(handle, "jpeg_mem_src", l.mem_src) &&
                     find(handle, "jpeg_read_header", l.read_header) &&
                     find(handle, "jpeg_start_decompress", l.start) &&
                     find(handle, "jpeg_read_scanlines", l.read_scanlines) &&
                     find(handle, "jpeg_abort_decompress", l.abort) &&
                     find(handle, "jpeg_destroy_decompress", l.destroy);
        return l;
    }();
    return opened;
}

// The library reports errors by a call that must not return.
struct Errors {
    jpeg_error_mgr manager;  // first: the library knows this part alone
    std::jmp_buf back;
    bool damaged;
};

void leave(j_common_ptr info) {
    std::longjmp(reinterpret_cast<Errors*>(info->err)->back, 1);
}

// A picture that ends early is filled up with grey, which the library only warns of.
void note(j_common_ptr info, int level) {
    if (level < 0) reinterpret_cast<Errors*>(info->err)->damaged = true;
}

}  // namespace

struct GreyJpegReader::State {
    jpeg_decompress_struct info{};
    Errors errors{};

    State() {
        info.err = library().std_error(&errors.manager);
        errors.manager.error_exit = leave;
        errors.manager.emit_message = note;
        library().create(&info, JPEG_LIB_VERSION, sizeof info);
    }
    ~State() { library().destroy(&info); }
};

GreyJpegReader::GreyJpegReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
GreyJpegReader::GreyJpegReader(GreyJpegReader&&) noexcept = default;
GreyJpegReader& GreyJpegReader::operator=(GreyJpegReader&&) noexcept = default;
GreyJpegReader::~GreyJpegReader() = default;

Result<GreyJpegReader> GreyJpegReader::create() {
    if (!library().complete) {
        return Error{"the library that reads a camera's pictures is not installed", "libjpeg.so.62",
                     "install it: apt install libjpeg62-turbo"};
    }
    return GreyJpegReader(std::make_unique<State>());
}

bool GreyJpegReader::read(std::span<const std::uint8_t> jpeg, GreyImage& image) {
    jpeg_decompress_struct& info = state_->info;
    state_->errors.damaged = false;
    // No object with a destructor lives between here and the end: longjmp would pass over it.
    if (setjmp(state_->errors.back) != 0) {
        library().abort(&info);
        return false;
    }
    library().mem_src(&info, jpeg.data(), jpeg.size());
    library().read_header(&info, TRUE);
    constexpr JDIMENSION kMaxSide = 8192;
    if (info.image_width > kMaxSide || info.image_height > kMaxSide ||
        (info.jpeg_color_space != JCS_YCbCr && info.jpeg_color_space != JCS_GRAYSCALE)) {
        library().abort(&info);
        return false;
    }
    info.out_color_space = JCS_GRAYSCALE;
    library().start(&info);
    image.width_px = static_cast<int>(info.output_width);
    image.height_px = static_cast<int>(info.output_height);
    image.pixels.resize(static_cast<std::size_t>(info.output_width) * info.output_height);
    while (info.output_scanline < info.output_height) {
        JSAMPROW row = image.pixels.data() +
                       static_cast<std::size_t>(info.output_scanline) * info.output_width;
        library().read_scanlines(&info, &row, 1);
    }
    library().abort(&info);
    return !state_->errors.damaged;
}

}  // namespace sonocase
