// SPDX-License-Identifier: Apache-2.0

// Stands in for ALSA's library in a test: the device "file:PATH" writes its samples to a file,
// every other device cannot be opened. The third block is refused once, as by a device that ran
// dry.
#include <cstdio>
#include <cstring>

namespace {
int g_blocks = 0;
}

extern "C" {

int snd_pcm_open(void** pcm, const char* name, int, int) {
    if (std::strncmp(name, "file:", 5) != 0) return -2;
    *pcm = std::fopen(name + 5, "wb");
    g_blocks = 0;
    return *pcm ? 0 : -2;
}
int snd_pcm_set_params(
    void*, int format, int access, unsigned channels, unsigned rate, int, unsigned) {
    return format == 2 && access == 3 && channels == 2 && rate == 24000 ? 0 : -22;
}
long snd_pcm_writei(void* pcm, const void* pairs, unsigned long count) {
    if (++g_blocks == 3) return -32;
    std::fwrite(pairs, 4, count, static_cast<std::FILE*>(pcm));
    std::fflush(static_cast<std::FILE*>(pcm));
    return static_cast<long>(count);
}
int snd_pcm_recover(void*, int, int) {
    return 0;
}
int snd_pcm_close(void* pcm) {
    return std::fclose(static_cast<std::FILE*>(pcm));
}

}  // extern "C"
