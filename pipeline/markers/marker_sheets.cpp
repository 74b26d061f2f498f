// SPDX-License-Identifier: Apache-2.0

#include "pipeline/markers/marker_sheets.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "formats/base/constants.h"
#include "formats/text/number_text.h"

namespace sonocase::pipeline::inline markers {
namespace {

using Kind = SheetMark::Kind;
constexpr double kBlack = 0, kWhite = 1, kPale = 0.55;
constexpr double kRulerMm = 100;
constexpr double kEdgeMm = 10;  // that printers leave white

Point3 at(double x, double y) {
    return {x, y, 0};
}

class Drawing {
  public:
    explicit Drawing(const Paper& paper) : sheet_{paper, {}} {}
    void fill(std::vector<Point3> points, double grey) {
        sheet_.marks.push_back({Kind::fill, std::move(points), grey, 0, {}});
    }
    void line(std::vector<Point3> points, double size_mm = 0.25, double grey = kBlack) {
        sheet_.marks.push_back({Kind::line, std::move(points), grey, size_mm, {}});
    }
    void dashes(Point3 a, Point3 b) {
        sheet_.marks.push_back({Kind::dashes, {a, b}, kPale, 0.2, {}});
    }
    void text(Point3 place, const std::string& words, double size_mm = 3.5, double grey = kBlack) {
        sheet_.marks.push_back({Kind::text, {place}, grey, size_mm, words});
    }
    // The square of a tag: its middle, and the directions of its right and upper edges on the
    // paper.
    void tag(int id, double edge_mm, Point3 middle, Vector3 right, Vector3 up) {
        const double cell = edge_mm / kTagCells;
        const auto corner = [&](double column, double row) {  // row from the top
            return middle + (column - 0.5 * kTagCells) * cell * right +
                   (0.5 * kTagCells - row) * cell * up;
        };
        const auto box = [&](double c0, double r0, double c1, double r1, double grey) {
            fill({corner(c0, r1), corner(c1, r1), corner(c1, r0), corner(c0, r0)}, grey);
        };
        box(0, 0, kTagCells, kTagCells, kBlack);
        // White on black, row by row. Where white goes on above, the boxes overlap a little: a
        // viewer that smooths edges would draw a thin dark line between them.
        constexpr double kOverlap = 0.02;
        for (int row = 0; row < kTagCells; ++row)
            for (int from = 0; from < kTagCells; ++from) {
                if (!tag_cell_is_white(id, row, from)) continue;
                int to = from;
                while (to < kTagCells && tag_cell_is_white(id, row, to)) ++to;
                box(from, row, to, row + 1, kWhite);
                for (int c = from; c < to; ++c)
                    if (row > 0 && tag_cell_is_white(id, row - 1, c))
                        box(c, row - kOverlap, c + 1, row + kOverlap, kWhite);
                from = to;
            }
    }
    void ruler(Point3 left) {
        const auto tick = [&](double x, double high) {
            line({left + Vector3{x, 0, 0}, left + Vector3{x, high, 0}}, 0.2);
        };
        line({left, left + Vector3{kRulerMm, 0, 0}}, 0.2);
        for (int mm = 0; mm <= kRulerMm; mm += 5)
            tick(mm, mm % 50 == 0 ? 5 : mm % 10 == 0 ? 3.5 : 2);
        for (int mm = 0; mm <= kRulerMm; mm += 50)
            text(left + Vector3{mm + 0.8, 3.8, 0}, std::to_string(mm), 2.6);
        text(left + Vector3{0, -4.5, 0},
             "This line has to be 100 mm long. If it is not, print again at 100 % (not \"fit to "
             "page\"), or",
             2.8);
        text(left + Vector3{0, -8.5, 0},
             "tell both programs its length: --ruler 97.5 is a line of 97.5 mm.", 2.8);
    }
    MarkerSheet take() { return std::move(sheet_); }

  private:
    MarkerSheet sheet_;
};

// The body from the side, on its stick: what is glued where.
void draw_mounting(Drawing& d, Point3 top_left, const MarkerBody& body, const BodyDrawing& size) {
    const double reach = std::abs(body.body_from_tool.translation.z);
    const double scale = 62 / (reach + size.height_mm);
    const bool probe = body.role == MarkerRole::probe;
    const double x = top_left.x + 22;
    const auto y = [&](double below_middle) {
        return top_left.y - (below_middle + 0.5 * size.height_mm) * scale;
    };
    const double h = 0.5 * size.height_mm;
    const double top = size.side_mm * 1.04 * scale,
                 low = (size.side_mm * 1.04 + 2 * h * 0.4663) * scale;
    d.line({at(x - low, y(h)), at(x + low, y(h)), at(x + top, y(-h)), at(x - top, y(-h)),
            at(x - low, y(h))},
           0.35);
    const double half = probe ? 4 : 1;
    d.line({at(x - half, y(h)), at(x - half, y(reach - 12)), at(x, y(reach)),
            at(x + half, y(reach - 12)), at(x + half, y(h))},
           0.35);
    if (probe) d.line({at(x - 8, y(reach)), at(x + 8, y(reach))}, 0.8);
    // The way between the body's middle and the face or tip.
    const double side = x + low + 6;
    d.line({at(side, y(0)), at(side, y(reach))}, 0.2);
    for (const double end : {0.0, reach})
        d.line({at(side - 1.5, y(end)), at(side + 1.5, y(end))}, 0.2);
    d.text(at(side + 2.5, y(0.5 * reach)), number_text(reach, 4) + " mm", 3);
    const double words = side + 26;
    double line_y = top_left.y - 3;
    const std::string end = probe ? "probe's face" : "needle's tip";
    const std::vector<std::string> lines = {
        "1  Cut along the solid lines, fold along the dashed ones.",
        "2  Glue the flaps inside. The tags stay flat: no wrinkles, no gloss.",
        "3  Fix the body on its stick: from the middle of its height",
        "    to the " + end + " " + number_text(reach, 4) + " mm, along the axis.",
        probe ? "4  Turn tag 0 to the side of the picture's right edge."
              : "4  The needle runs along the axis of the body.",
        "5  Measure the ruler.",
        "6  sonocase markers --calibrations FOLDER",
        "    writes how the player has to take this."};
    for (const std::string& line : lines) {
        d.text(at(words, line_y), line, 3);
        line_y -= 5;
    }
}

Result<MarkerSheet> body_sheet(const MarkerBody& body,
                               const MarkerSizes& sizes,
                               const Paper& paper) {
    Drawing d(paper);
    const BodyDrawing size = body_drawing(sizes.body_mm);
    const double s = size.side_mm, half = kPi / kBodySides;
    const double radius = s / (2 * std::tan(half));
    // From the faces themselves, so that the sheet and the model cannot differ: the sides are
    // turned about their upper edges into the plane of the top.
    const double low = 0.5 * s + [&] {
        const MarkerFace& face = body.faces[0];
        return -(inverse(body.tags[0].body_from_tag) * face.corners[0]).y;
    }();
    const Point3 middle = at(0.5 * paper.width_mm, paper.height_mm - kEdgeMm - 12 - radius - low);
    constexpr double kFlapMm = 6;
    if (middle.y - radius - low < 118 || 2 * (radius + low) > paper.width_mm - 2 * kEdgeMm)
        return Error{Message("a body of {} mm does not fit {} paper",
                             {number_text(sizes.body_mm, 4), paper.name}),
                     "markers", "choose a smaller --body"};
    d.text(at(kEdgeMm + 5, paper.height_mm - kEdgeMm - 6),
           "sonocase markers: " + body.name + " body, tags " +
               std::to_string(body.tags.front().id) + " to " + std::to_string(body.tags.back().id) +
               ", " + number_text(sizes.body_mm, 4) + " mm, tags of " +
               fixed_text(size.side_tag_mm, 2) + " and " + fixed_text(size.top_tag_mm, 2) + " mm",
           3.5);
    for (int k = 0; k < kBodySides; ++k) {
        const double turn = 2 * kPi * k / kBodySides;
        const Vector3 out{std::cos(turn), std::sin(turn), 0},
            along{-std::sin(turn), std::cos(turn), 0};
        const MarkerFace& face = body.faces[k];
        const Rigid tag_from_body = inverse(body.tags[k].body_from_tag);
        std::vector<Point3> flat;
        const Point3 centre = middle + (radius + 0.5 * s) * out;
        for (const Point3& corner : face.corners) {
            const Point3 p = tag_from_body * corner;
            flat.push_back(centre + p.x * along - p.y * out);
        }
        d.dashes(flat[2], flat[3]);
        // Lower left, lower right, upper right, upper left: the flap is on the right.
        const Vector3 edge = normalized(flat[2] - flat[1]);
        const Vector3 aside = {edge.y, -edge.x, 0};
        const Vector3 away = dot(aside, along) > 0 ? aside : -aside;
        const double length = distance(flat[1], flat[2]);
        d.dashes(flat[1], flat[2]);
        d.line({flat[2], flat[2] - 0.45 * length * edge + kFlapMm * away,
                flat[1] + 3 * edge + kFlapMm * away, flat[1], flat[0], flat[3]});
        d.tag(body.tags[k].id, size.side_tag_mm, centre, along, -out);
        d.text(middle + (radius + low - 1) * out, std::to_string(body.tags[k].id), 2.2, kPale);
    }
    d.tag(body.tags[kBodySides].id, size.top_tag_mm, middle, {1, 0, 0}, {0, 1, 0});
    draw_mounting(d, at(kEdgeMm + 5, 108), body, size);
    d.ruler(at(kEdgeMm + 8, 24));
    return d.take();
}

Result<MarkerSheet> board_sheet(const MarkerBody& board,
                                const MarkerSizes& sizes,
                                const Paper& paper) {
    Drawing d(paper);
    const double pitch = board_pitch_mm(sizes);
    if (kBoardColumns * pitch > paper.width_mm - 2 * kEdgeMm + 12 ||
        kBoardRows * pitch > paper.height_mm - 56)
        return Error{Message("a board with tags of {} mm does not fit {} paper",
                             {number_text(sizes.board_tag_mm, 4), paper.name}),
                     "markers", "choose a smaller --board-tag"};
    const Point3 middle = at(0.5 * paper.width_mm, 38 + 0.5 * kBoardRows * pitch);
    d.text(at(kEdgeMm + 5, paper.height_mm - kEdgeMm - 3),
           "sonocase markers: board, tags " + std::to_string(board.tags.front().id) + " to " +
               std::to_string(board.tags.back().id) + " of " + number_text(sizes.board_tag_mm, 4) +
               " mm, " + number_text(pitch, 5) + " mm apart; glue it flat on stiff card",
           3.2);
    for (const MarkerTag& tag : board.tags) {
        const Point3 place = middle + (tag.body_from_tag * Point3{} - Point3{});
        d.tag(tag.id, sizes.board_tag_mm, place, {1, 0, 0}, {0, 1, 0});
        d.text(place + Vector3{-1.5, -0.5 * pitch - 1, 0}, std::to_string(tag.id), 2.2, kPale);
    }
    d.ruler(at(kEdgeMm + 8, 20));
    return d.take();
}

// A number of a PDF: no exponent.
std::string number(double value) {
    std::string text = fixed_text(value, 4);
    if (text == "-0.0000") text = "0.0000";
    return text + " ";
}

std::string point(Point3 p) {
    return number(p.x) + number(p.y);
}

std::string content_of(const MarkerSheet& sheet) {
    std::string out = number(72 / 25.4) + "0 0 " + number(72 / 25.4) + "0 0 cm\n1 J 1 j\n";
    for (const SheetMark& mark : sheet.marks) {
        if (mark.kind == Kind::text) {
            std::string words;
            for (const char c : mark.text) {
                if (c == '(' || c == ')' || c == '\\') words += '\\';
                words += c;
            }
            out += number(mark.grey) + "g BT /F1 " + number(mark.size_mm) + "Tf " +
                   point(mark.points[0]) + "Td (" + words + ") Tj ET\n";
            continue;
        }
        const bool fill = mark.kind == Kind::fill;
        out += number(mark.grey) + (fill ? "g " : "G ");
        if (!fill) out += number(mark.size_mm) + "w ";
        if (mark.kind == Kind::dashes) out += "[2 1.5] 0 d ";
        for (std::size_t k = 0; k < mark.points.size(); ++k)
            out += point(mark.points[k]) + (k == 0 ? "m " : "l ");
        out += fill ? "h f" : "S";
        if (mark.kind == Kind::dashes) out += " [] 0 d";
        out += "\n";
    }
    return out;
}

}  // namespace

Result<std::vector<MarkerSheet>> marker_sheets(const MarkerSizes& sizes, const Paper& paper) {
    MarkerSizes drawn = sizes;
    drawn.ruler_mm = 100;
    std::vector<MarkerSheet> sheets;
    for (const MarkerBody& body : marker_bodies(drawn)) {
        SONOCASE_TRY(MarkerSheet sheet, body.role == MarkerRole::board
                                            ? board_sheet(body, drawn, paper)
                                            : body_sheet(body, drawn, paper));
        sheets.push_back(std::move(sheet));
    }
    return sheets;
}

std::string pdf_of(const std::vector<MarkerSheet>& sheets) {
    // Objects: 1 catalogue, 2 pages, 3 font, then a page and its content for each sheet.
    std::vector<std::string> objects;
    std::string kids;
    for (std::size_t k = 0; k < sheets.size(); ++k) kids += std::to_string(4 + 2 * k) + " 0 R ";
    objects.push_back(
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>");
    objects.push_back("<< /Type /Pages /Kids [ " + kids + "] /Count " +
                      std::to_string(sheets.size()) + " >>");
    objects.push_back(
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>");
    for (std::size_t k = 0; k < sheets.size(); ++k) {
        const Paper& paper = sheets[k].paper;
        const std::string content = content_of(sheets[k]);
        objects.push_back("<< /Type /Page /Parent 2 0 R /MediaBox [ 0 0 " +
                          number(paper.width_mm * 72 / 25.4) + number(paper.height_mm * 72 / 25.4) +
                          "] /Resources << /Font << /F1 3 0 R >> >> /Contents " +
                          std::to_string(5 + 2 * k) + " 0 R >>");
        objects.push_back("<< /Length " + std::to_string(content.size()) + " >>\nstream\n" +
                          content + "endstream");
    }
    std::string pdf = "%PDF-1.4\n", table;
    for (std::size_t k = 0; k < objects.size(); ++k) {
        std::string offset = std::to_string(pdf.size());
        offset.insert(0, 10 - offset.size(), '0');
        table += offset + " 00000 n \n";
        pdf += std::to_string(k + 1) + " 0 obj\n" + objects[k] + "\nendobj\n";
    }
    const std::size_t start = pdf.size();
    const std::string count = std::to_string(objects.size() + 1);
    pdf += "xref\n0 " + count + "\n0000000000 65535 f \n" + table + "trailer\n<< /Size " + count +
           " /Root 1 0 R >>\nstartxref\n" + std::to_string(start) + "\n%%EOF\n";
    return pdf;
}

std::string stl_of(const MarkerBody& body) {
    std::vector<std::vector<Point3>> faces;
    std::vector<Point3> base;
    for (const MarkerFace& face : body.faces) faces.push_back(face.corners);
    for (int k = kBodySides - 1; k >= 0; --k) base.push_back(body.faces[k].corners[0]);
    faces.push_back(base);
    const double lift = -base[0].z;
    std::string out(80, ' ');
    const std::string title = "sonocase marker body: " + body.name;
    std::copy(title.begin(), title.end(), out.begin());
    const auto put = [&](auto value) {
        const auto bytes = std::bit_cast<std::array<char, sizeof value>>(value);
        out.append(bytes.begin(), bytes.end());
    };
    std::uint32_t count = 0;
    for (const auto& face : faces) count += static_cast<std::uint32_t>(face.size()) - 2;
    put(count);
    for (const auto& face : faces)
        for (std::size_t k = 1; k + 1 < face.size(); ++k) {
            const Vector3 n = normalized(cross(face[k] - face[0], face[k + 1] - face[0]));
            for (int c = 0; c < 3; ++c) put(static_cast<float>(n[c]));
            for (const Point3& p : {face[0], face[k], face[k + 1]})
                for (int c = 0; c < 3; ++c) put(static_cast<float>(p[c] + (c == 2 ? lift : 0)));
            put(std::uint16_t{0});
        }
    return out;
}

}  // namespace sonocase::pipeline::inline markers
