// SPDX-License-Identifier: Apache-2.0

// The sheets are drawn from the bytes of the PDF, as a printer would, and looked at.

#include "pipeline/markers/marker_sheets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <sstream>

#include "formats/markers/detect/tag_detector.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPxPerMm = 5;
constexpr double kPointMm = 25.4 / 72;

struct Page {
    int width_px = 0, height_px = 0;
    std::vector<std::uint8_t> grey;
    Box3 inked_mm;        // of fills and lines
    double ruler_mm = 0;  // the longest level line of one stroke
    std::string words;
};

void fill(Page& page, const std::vector<Point3>& outline, double grey) {
    const int samples = 4;
    for (int y = 0; y < page.height_px; ++y)
        for (int s = 0; s < samples; ++s) {
            // Scan lines: where the outline crosses, sorted.
            const double y_mm = (page.height_px - y - (s + 0.5) / samples) / kPxPerMm;
            std::vector<double> cuts;
            for (std::size_t k = 0; k < outline.size(); ++k) {
                const Point3 a = outline[k], b = outline[(k + 1) % outline.size()];
                if ((a.y > y_mm) != (b.y > y_mm))
                    cuts.push_back((a.x + (y_mm - a.y) / (b.y - a.y) * (b.x - a.x)) * kPxPerMm);
            }
            std::sort(cuts.begin(), cuts.end());
            for (std::size_t k = 0; k + 1 < cuts.size(); k += 2)
                for (int x = std::max(0, static_cast<int>(cuts[k]));
                     x < std::min<double>(page.width_px, cuts[k + 1]); ++x) {
                    const double part =
                        std::min(x + 1.0, cuts[k + 1]) - std::max<double>(x, cuts[k]);
                    std::uint8_t& pixel =
                        page.grey[static_cast<std::size_t>(y) * page.width_px + x];
                    pixel = static_cast<std::uint8_t>(pixel +
                                                      part / samples * (255 * grey - pixel) + 0.5);
                }
        }
}

// Reads what the writer writes: objects by the table of their places, and the drawing commands.
std::vector<Page> draw(const std::string& pdf) {
    std::vector<Page> pages;
    const std::size_t table = std::stoul(pdf.substr(pdf.rfind("startxref") + 10));
    EXPECT_EQ(pdf.compare(table, 4, "xref"), 0);
    std::istringstream lines(pdf.substr(table));
    std::string line;
    std::getline(lines, line), std::getline(lines, line);
    int count = std::stoi(line.substr(2));
    std::getline(lines, line);
    std::map<int, std::string> objects;
    for (int k = 1; k < count; ++k) {
        std::getline(lines, line);
        const std::size_t at = std::stoul(line.substr(0, 10));
        EXPECT_EQ(pdf.compare(at, std::to_string(k).size() + 6, std::to_string(k) + " 0 obj"), 0);
        objects[k] = pdf.substr(at, pdf.find("endobj", at) - at);
    }
    for (const auto& [number, object] : objects) {
        const std::size_t box = object.find("/MediaBox [ 0 0 ");
        if (box == std::string::npos) continue;
        Page page;
        double w = 0, h = 0;
        std::istringstream(object.substr(box + 16)) >> w >> h;
        page.width_px = static_cast<int>(std::lround(w * kPointMm * kPxPerMm));
        page.height_px = static_cast<int>(std::lround(h * kPointMm * kPxPerMm));
        page.grey.assign(static_cast<std::size_t>(page.width_px) * page.height_px, 255);
        const std::string& content = objects[number + 1];
        const std::size_t begin = content.find("stream\n") + 7;
        std::istringstream words(content.substr(begin, content.find("endstream") - begin));
        std::vector<double> stack;
        std::vector<Point3> path;
        double grey = 0;
        std::string word;
        while (words >> word) {
            if (word[0] == '(') {
                while (word.back() != ')') {
                    std::string more;
                    words >> more;
                    word += " " + more;
                }
                page.words += word + "\n";
                continue;
            }
            char* end = nullptr;
            const double value = std::strtod(word.c_str(), &end);
            if (*end == 0) {
                stack.push_back(value);
                continue;
            }
            if (word == "cm") {
                EXPECT_NEAR(stack[0], 1 / kPointMm, 1e-4);
            }
            if (word == "g") grey = stack[0];
            if (word == "m") path.clear();
            if (word == "m" || word == "l") path.push_back({stack[0], stack[1], 0});
            if (word == "f") fill(page, path, grey);
            if (word == "f" || word == "S")
                for (const Point3& p : path) page.inked_mm.include(p);
            if (word == "S" && path.size() == 2 && path[0].y == path[1].y)
                page.ruler_mm = std::max(page.ruler_mm, std::abs(path[1].x - path[0].x));
            stack.clear();
        }
        pages.push_back(std::move(page));
    }
    return pages;
}

std::vector<SeenTag> tags_on(const Page& page) {
    auto detector = TagDetector::create();
    EXPECT_TRUE(detector);
    return detector->find({page.grey.data(), page.width_px, page.height_px, page.width_px}).tags;
}

double edge_mm(const SeenTag& tag, int k) {
    const Pixel a = tag.corners[k], b = tag.corners[(k + 1) % 4];
    return std::hypot(a.x - b.x, a.y - b.y) / kPxPerMm;
}

TEST(MarkerSheets, ThePrintedTagsAreReadAndHaveTheirSizes) {
    MarkerSizes sizes;
    const auto bodies = marker_bodies(sizes);
    const auto sheets = marker_sheets(sizes, kPapers[0]);
    ASSERT_TRUE(sheets);
    const std::vector<Page> pages = draw(pdf_of(*sheets));
    ASSERT_EQ(pages.size(), bodies.size());
    for (std::size_t b = 0; b < pages.size(); ++b) {
        const std::vector<SeenTag> seen = tags_on(pages[b]);
        EXPECT_EQ(seen.size(), bodies[b].tags.size()) << bodies[b].name;
        for (const SeenTag& tag : seen) {
            const TagPlace place = find_tag(bodies, tag.id);
            ASSERT_EQ(place.body, static_cast<int>(b));
            // Edges along the raster and sharper than any lens makes them are found to half a
            // pixel, which is 0.1 mm, four together to a tenth of the 3 % by which printers change
            // pages.
            double mean_mm = 0;
            for (int k = 0; k < 4; ++k) {
                EXPECT_NEAR(edge_mm(tag, k), bodies[b].tags[place.tag].edge_mm, 0.1) << tag.id;
                mean_mm += edge_mm(tag, k) / 4;
            }
            EXPECT_NEAR(mean_mm / bodies[b].tags[place.tag].edge_mm, 1, 0.003) << tag.id;
        }
        EXPECT_DOUBLE_EQ(pages[b].ruler_mm, 100);
        EXPECT_NE(pages[b].words.find("100 mm long"), std::string::npos);
    }
    // The board's tags lie where the model has them.
    const std::vector<SeenTag> board = tags_on(pages[2]);
    const auto middle = [](const SeenTag& t) {
        return Point3{(t.corners[0].x + t.corners[2].x) / 2, -(t.corners[0].y + t.corners[2].y) / 2,
                      0};
    };
    for (const SeenTag& tag : board) {
        const Vector3 seen = (middle(tag) - middle(board[0])) / kPxPerMm;
        const auto& tags = bodies[2].tags;
        const Vector3 meant = tags[find_tag(bodies, tag.id).tag].body_from_tag * Point3{} -
                              tags[find_tag(bodies, board[0].id).tag].body_from_tag * Point3{};
        EXPECT_NEAR(norm(seen - meant), 0, 0.03) << tag.id;
    }
}

TEST(MarkerSheets, EverySheetFitsBothPapersOrIsRefused) {
    for (const Paper& paper : kPapers)
        for (const double body_mm : {25.0, 40.0, 56.0}) {
            MarkerSizes sizes;
            sizes.body_mm = body_mm;
            const auto sheets = marker_sheets(sizes, paper);
            if (!sheets) {
                EXPECT_EQ(body_mm, 56) << paper.name;
                EXPECT_NE(sheets.error().message().find("does not fit"), std::string::npos);
                continue;
            }
            for (const MarkerSheet& sheet : *sheets)
                for (const SheetMark& mark : sheet.marks)
                    for (const Point3& p : mark.points) {
                        EXPECT_GT(std::min(p.x, p.y), 8) << mark.text;
                        EXPECT_LT(p.x, paper.width_mm - 8) << mark.text;
                        EXPECT_LT(p.y, paper.height_mm - 8) << mark.text;
                    }
            EXPECT_EQ(pdf_of(*sheets), pdf_of(*marker_sheets(sizes, paper)));
        }
}

TEST(MarkerSheets, AFoldedSheetIsTheBody) {
    // Each side keeps its upper edge with the top: in the net the two lie on the same fold.
    const MarkerSizes sizes;
    const MarkerBody body = marker_bodies(sizes)[0];
    const auto sheets = marker_sheets(sizes, kPapers[0]);
    ASSERT_TRUE(sheets);
    std::vector<double> dashes;
    for (const SheetMark& mark : (*sheets)[0].marks)
        if (mark.kind == SheetMark::Kind::dashes)
            dashes.push_back(distance(mark.points[0], mark.points[1]));
    // For each side: its fold at the top and its fold to the flap.
    ASSERT_EQ(dashes.size(), 2u * kBodySides);
    for (int k = 0; k < kBodySides; ++k) {
        const auto& c = body.faces[k].corners;
        EXPECT_NEAR(dashes[2 * k], distance(c[2], c[3]), 1e-9);
        EXPECT_NEAR(dashes[2 * k + 1], distance(c[1], c[2]), 1e-9);
        EXPECT_NEAR(distance(c[3], body.faces.back().corners[(k + 6) % 7]), 0, 1e-9);
    }
}

TEST(MarkerSheets, TheSolidIsClosed) {
    for (const int b : {0, 1}) {
        const std::string stl = stl_of(marker_bodies()[b]);
        std::uint32_t count = 0;
        std::memcpy(&count, stl.data() + 80, 4);
        ASSERT_EQ(stl.size(), 84 + 50u * count);
        std::map<std::array<long, 6>, int> edges;
        double volume = 0, low = 1e9;
        for (std::uint32_t t = 0; t < count; ++t) {
            float f[12];
            std::memcpy(f, stl.data() + 84 + 50 * t, 48);
            std::array<Point3, 3> p;
            for (int k = 0; k < 3; ++k) p[k] = {f[3 + 3 * k], f[4 + 3 * k], f[5 + 3 * k]};
            volume += dot(p[0] - Point3{}, cross(p[1] - Point3{}, p[2] - Point3{})) / 6;
            for (int k = 0; k < 3; ++k) {
                const Point3 a = p[k], c = p[(k + 1) % 3];
                low = std::min(low, a.z);
                const auto r = [](double v) { return std::lround(v * 1000); };
                ++edges[{r(a.x), r(a.y), r(a.z), r(c.x), r(c.y), r(c.z)}];
            }
        }
        for (const auto& [edge, times] : edges) {
            EXPECT_EQ(times, 1);
            EXPECT_EQ(edges.count({edge[3], edge[4], edge[5], edge[0], edge[1], edge[2]}), 1u);
        }
        EXPECT_GT(volume, 1e4);  // mm3, outward
        EXPECT_NEAR(low, 0, 1e-4);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
