// SPDX-License-Identifier: Apache-2.0

// What a bundle's manifest may say, and that anything else is an error.
#include <gtest/gtest.h>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/chunk_file.h"
#include "support/random.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;

// `more`: further members of the one tissue, with the comma before them.
std::string manifest_with(const std::string& more) {
    return R"({"grid":{"size":[1,1,1],"spacing_mm":[1,1,1],"origin_mm":[0,0,0],)"
           R"("direction":[1,0,0,0,1,0,0,0,1]},"labels":[{"name":"o","tissue":"t"}],)"
           R"("tissues":[{"name":"t","kind":"soft")" +
           more + R"(}],"textures":[],"speckle_edge":0})";
}

Result<CaseBundle> read_manifest(const std::string& manifest) {
    ChunkWriter writer("CASE");
    writer.add("manifest", true, Bytes(manifest.begin(), manifest.end()));
    return read_bundle(writer.write(), "made");
}

TEST(BundleManifest, ATissuesMechanicsComeBack) {
    CaseBundle bundle = testing::tiny_case();
    const Bytes without = write_bundle(bundle);
    bundle.tissues[1].mechanics = TissueMechanics{0.6, true, 0.4, false};
    const auto back = read_bundle(write_bundle(bundle), "a");
    ASSERT_TRUE(back) << back.error().message();
    for (std::size_t i = 0; i < bundle.tissues.size(); ++i)
        EXPECT_EQ(back->tissues[i].mechanics, bundle.tissues[i].mechanics);
    // Where no recipe gave figures nothing is written: older bundles keep their bytes.
    const std::string text(without.begin(), without.end());
    EXPECT_EQ(text.find("stiffness"), std::string::npos);
}

TEST(BundleManifest, ImpossibleMechanicsAreRefusedByName) {
    for (const char* bad :
         {R"({"stiffness_kpa":0})", R"({"stiffness_kpa":null})", R"({"stiffness_kpa":-3})",
          R"({"stiffness_kpa":1e5})", R"({"drains":true})", R"({"stiffness_kpa":"soft"})",
          R"({"stiffness_kpa":8,"puncture_n":-1})", R"({"stiffness_kpa":8,"puncture_n":101})",
          "[]"}) {
        const auto refused = read_manifest(manifest_with(std::string(R"(,"mechanics":)") + bad));
        ASSERT_FALSE(refused) << bad;
        EXPECT_NE(refused.error().message().find("mechanics"), std::string::npos)
            << refused.error().message();
    }
}

TEST(BundleManifest, RandomBytesNeverCrash) {
    testing::Random random(5);
    const std::string text = manifest_with("");
    for (int i = 0; i < 3000; ++i) {
        std::string changed = text;
        for (int k = 0; k < 1 + i % 3; ++k) {
            changed[static_cast<std::size_t>(random.uniform(0, static_cast<double>(text.size())))] =
                static_cast<char>(random.uniform(0, 256));
        }
        (void)read_manifest(changed);
    }
}

TEST(BundleManifest, DeepNestingIsAnErrorNotAnOverflow) {
    EXPECT_FALSE(read_manifest("{\"a\":" + std::string(200000, '[')));
}

}  // namespace
}  // namespace sonocase
