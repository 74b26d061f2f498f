// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/point_table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

// Ten points of a helix: no column of theirs steps evenly.
Point3 place(int n) {
    return {100 * std::cos(0.7 * n), 80 * std::sin(0.7 * n), 3.0 * n * n};
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3f", value);
    return text;
}

// Ten rows: x, y and z of a place between what stands before and after them; %n is the row's
// number.
std::string rows(const std::string& before, const std::string& after, const std::string& gap) {
    std::string out;
    const auto numbered = [](std::string text, int n) {
        for (std::size_t at; (at = text.find("%n")) != std::string::npos;)
            text.replace(at, 2, std::to_string(n));
        return text;
    };
    for (int n = 0; n < 10; ++n) {
        const Point3 p = place(n);
        out += numbered(before, n) + number(p.x) + gap + number(p.y) + gap + number(p.z) +
               numbered(after, n) + "\n";
    }
    return out;
}

std::string with_commas(std::string text) {
    for (char& c : text)
        if (c == '.') c = ',';
    return text;
}

void expect_places(const Result<PointTable>& table, const std::string& what) {
    ASSERT_TRUE(table) << what << ": " << table.error().message();
    ASSERT_EQ(table->points.size(), 10u) << what;
    for (int n = 0; n < 10; ++n)
        EXPECT_LT(distance(table->points[static_cast<std::size_t>(n)], place(n)), 1e-3) << what;
}

std::string refusal(const std::string& text, const PointTableOptions& options = {}) {
    const auto table = parse_point_table(text, "a.csv", options);
    return table ? "read" : table.error().message();
}

TEST(PointTable, FindsColumnsByTheirNames) {
    const std::string csv = rows("", "", ","), numbered = rows("%n,", ",7", ",");
    const std::string tum = rows("0.%n5 ", " 0 0 0 1", " ");
    const std::pair<const char*, std::string> tables[] = {
        {"names", "x,y,z\n" + csv},
        {"units", "x_mm,Y [mm],Z (mm)\n" + csv},
        {"number before", "n,x,y,z,v\n" + numbered},
        {"numpy", "# n,x,y,z,v\n" + numbered},
        {"signs of comments alone", "#\n%\n# n,x,y,z,v\n#\n//\n" + numbered},
        {"TUM", "# ground truth\n# timestamp tx ty tz qx qy qz qw\n" + tum},
        {"names with commas over blanks", "time,tx,ty,tz,qx,qy,qz,qw\n" + tum},
        {"CloudCompare", "//X Y Z R G B\n" + rows("", " 10 20 30", " ")},
        {"Matlab", "% n, x, y, z, v\n" + numbered},
        {"positions", "frame,Position X,Position Y,Position Z,w\n" + numbered},
        {"ParaView", "id,\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\"\n" + numbered},
        {"ROS",
         "%time,field.pose.position.x,field.pose.position.y,field.pose.position.z,"
         "field.pose.orientation.x\n" +
             numbered},
        {"fcsv",
         "# Markups fiducial file version = 4.11\n# CoordinateSystem = RAS\n"
         "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n" +
             rows("%n,", ",0,0,0,1,1,1,0,F-%n,,", ",")},
        {"fcsv of Slicer 5, with two cells more than names",
         "# Markups fiducial file version = 5.6\n# CoordinateSystem = RAS\n"
         "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n" +
             rows("%n,", ",0,0,0,1,0,1,0,F-%n,,vtkMRMLScalarVolumeNode1,2,0", ",")},
        {"Slicer's table of markups, all hidden",
         "label,r,a,s,defined,selected,visible,locked,description\n" +
             rows("F-%n,", ",1,1,0,0,", ",") + "F-11,0,0,0,0,1,1,0,\n"},
        {"NDI", "Tools,Port 1,Frame,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error\n" +
                    rows("1,P,%n,OK,1,0,0,0,", ",0.1", ",")},
        {"German", "sep=;\nname;x;y;z\n" + with_commas(rows("p%n;", "", ";"))},
        {"tabs", "frame\tx\ty\tz\n" + with_commas(rows("%n\t", "", "\t"))},
        {"BOM", "\xEF\xBB\xBFx;y;z\r\n" + rows("", "\r", ";")},
        {"row of units", "t,x,y,z,v\ns,mm,mm,mm,-\n" + numbered},
    };
    for (const auto& [what, text] : tables) expect_places(parse_point_table(text, "a"), what);
}

TEST(PointTable, ReadsNamelessColumnsThatCanMeanOneThing) {
    for (const auto& [what, text] :
         {std::pair<const char*, std::string>{"three", rows("", "", " ")},
          {"count", "10\n" + rows("", "", " ")},
          {"brackets", rows("[", "],", ", ")},
          {"parentheses", rows("(", ")", ", ")},
          {"decimal commas", with_commas(rows("", "", " "))},
          {"normals", rows("", " 0 0.6 0.8", " ")},
          {"colours", rows("", ",255,0,12", ",")},
          {"PTS", "10\n" + rows("", " -1017", " ")},
          {"PTS with colours", "10\n" + rows("", " -1017 10 20 30", " ")},
          {"name", rows("p%n,", "", ",")}})
        expect_places(parse_point_table(text, "a"), what);
    const auto normals = parse_point_table(rows("", " 0 0.6 0.8", " "), "a");
    ASSERT_EQ(normals->normals.size(), 10u);
    EXPECT_NEAR(normals->normals[3].z, 0.8, 1e-9);
    EXPECT_TRUE(parse_point_table(rows("", ",255,0,12", ","), "a")->normals.empty());
    EXPECT_EQ(parse_point_table(rows("p%n,", "", ","), "a")->names[4], "p4");
    expect_places(parse_point_table(rows("%n,", "", ","), "a", {.names = true}),
                  "numbers as names");
}

// Each refusal names the file, the question and lines to add; with the right one of them the table
// is read, and as it was written.
TEST(PointTable, AsksWhichColumnsAreMeantAndItsAdviceWorks) {
    const struct {
        const char* what;
        std::string text, line;
    } cases[] = {
        {"a value behind", rows("", ",5.5", ","), "x,y,z,c4"},
        {"a number before", rows("%n,", "", ","), "n,x,y,z"},
        {"time before", rows("0.%n ", "", " "), "time,x,y,z"},
        {"TUM", rows("0.%n ", " 0 0 0 1", " "), "time,x,y,z,qx,qy,qz,qw"},
        {"position and turn", rows("", ",0.1,0.2,0.3,0.9", ","), "x,y,z,qx,qy,qz,qw"},
        {"turn and position", rows("1;0;0;0;", "", ";"), "qw,qx,qy,qz,x,y,z"},
        {"intensity, colours, no count", rows("", " 7 10 20 30", " "), "x,y,z,qx,qy,qz,qw"},
        {"count, turns", "10\n" + rows("", " 0.1 0.2 0.3 0.9", " "), "x,y,z,qx,qy,qz,qw"},
        {"count, times", "10\n" + rows("0.%n ", "", " "), "time,x,y,z"},
        {"five", rows("%n,0.5,", "", ","), "n,time,x,y,z"},
        {"angles", rows("", ",0.1,-0.2,12.5", ","), "x,y,z,c4,c5,c6"}};
    for (const auto& c : cases) {
        const std::string said = refusal(c.text);
        EXPECT_NE(said.find("which columns are x, y and z?"), std::string::npos) << c.what << said;
        EXPECT_NE(said.find("a.csv:"), std::string::npos) << c.what << said;
        EXPECT_NE(said.find(std::string("'") + c.line + "'"), std::string::npos) << c.what << said;
        expect_places(parse_point_table(std::string(c.line) + "\n" + c.text, "a"), c.what);
        expect_places(parse_point_table("# " + std::string(c.line) + "\n" + c.text, "a"), c.what);
    }
    // A number and two coordinates: three columns, and none of them is x.
    std::string flat;
    for (int n = 0; n < 10; ++n)
        flat += std::to_string(n) + "," + number(place(n).x) + "," + number(place(n).y) + "\n";
    EXPECT_NE(refusal(flat).find("counts upwards"), std::string::npos);
    EXPECT_EQ(refusal("x,y,z\n" + flat), "read");
}

// Commas between cells and within numbers: x and its tenths, y and its tenths, ... in centimetres.
TEST(PointTable, DecimalCommasAmongCommasAreNotTakenForColumns) {
    std::string commas, semicolons;
    for (int n = 0; n < 40; ++n) {
        const std::string x = std::to_string(12 + n % 7) + ",5",
                          y = std::to_string(3 + n % 5) + ",2",
                          z = std::to_string(n) + "," + std::to_string(n % 10);
        commas += x + "," + y + "," + z + "\n";
        semicolons += x + ";" + y + ";" + z + "\n";
    }
    const std::string message = refusal(commas);
    EXPECT_NE(message.find("is a decimal comma among them?"), std::string::npos) << message;
    const auto told = parse_point_table(semicolons, "a");  // the first advice
    ASSERT_TRUE(told) << told.error().message();
    EXPECT_EQ(told->points[3], (Point3{15.5, 6.2, 3.3}));
    const auto named = parse_point_table("x,y,z,c4,c5,c6\n" + commas, "a");  // the second
    ASSERT_TRUE(named) << named.error().message();
    EXPECT_EQ(named->points[3], (Point3{15, 5, 6}));
    // Whole numbers between blanks are x, y, z and a colour.
    std::string blanks = commas;
    for (char& c : blanks)
        if (c == ',') c = ' ';
    EXPECT_TRUE(parse_point_table(blanks, "a"));
}

TEST(PointTable, RefusesNamesThatAreNotCertain) {
    EXPECT_NE(refusal("Frame,Time,X,Y,Z,W,X,Y,Z,\n" + rows("0,0,0,.1,.2,.9,", ",.1", ","))
                  .find("Two have the same name"),
              std::string::npos);
    // The advice: others get names of their own; the last may have none.
    expect_places(parse_point_table(
                      "Frame,Time,qx,qy,qz,qw,X,Y,Z,\n" + rows("0,0,0,.1,.2,.9,", ",.1", ","), "a"),
                  "renamed");
    EXPECT_NE(refusal("x,y,z,tx,ty,tz\n1,2,3,4,5,6\n").find("Several could be"), std::string::npos);
    EXPECT_NE(refusal("x,y,z\n1,5,2,5,3,5\n").find("6 cells under 3 names"), std::string::npos);
    EXPECT_NE(refusal("x_mm,y_cm,z_mm\n1,2,3\n").find("different units"), std::string::npos);
    EXPECT_NE(refusal("alpha,beta\n1,2\n").find("no columns x, y, z"), std::string::npos);
    EXPECT_NE(refusal("x,y,z\n1,2,3\n1,,3\n").find("a.csv:3"), std::string::npos);
    EXPECT_NE(refusal("12\n" + rows("", "", " ")).find("says that it holds 12 points"),
              std::string::npos);
    EXPECT_NE(refusal("# CoordinateSystem = 2\nx,y,z\n1,2,3\n").find("coordinate system"),
              std::string::npos);
}

// Motive: the position counts and not the rotation, the body and not its markers; metres.
TEST(PointTable, ReadsOptiTracksBody) {
    const std::string head =
        "Format Version,1.23,Take Name,torso,Capture Frame Rate,120.000000,Export Frame Rate,"
        "120.000000,Total Exported Frames,11,Rotation Type,Quaternion,Length Units,Meters,"
        "Coordinate Space,Global\n\n"
        ",,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,"
        "Marker,Marker\n"
        ",,Tip,Tip,Tip,Tip,Tip,Tip,Tip,M1,M1,M1\n,,A,A,A,A,A,A,A,B,B,B\n"
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,"
        "Position\n"
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z\n";
    const auto table = parse_point_table(
        head + rows("%n,0.%n,0,0,0,1,", ",1,2,3", ",") + "10,1.0,,,,,,,,1,2,3\n", "a");
    expect_places(table, "Motive");
    EXPECT_EQ(table->unit_mm, 1000);
    EXPECT_EQ(table->left_out, 1u);
    // Without markers; the mean error has no name.
    expect_places(parse_point_table(",,Rotation,Rotation,Rotation,Rotation,Position,Position,"
                                    "Position,Mean Marker Error\nFrame,Time,X,Y,Z,W,X,Y,Z,\n" +
                                        rows("%n,0.%n,0,0,0,1,", ",0.002", ","),
                                    "a"),
                  "one body");
}

TEST(PointTable, LeavesMissedReadingsOutAndCountsThem) {
    const auto table = parse_point_table("Frame,State,Tx,Ty,Tz\n0,MISSING\n1,MISSING,,,\n" +
                                             rows("2,OK,", "", ",") +
                                             "3,Out of volume,0,0,0\n4,OK,nan,nan,nan\n5,OK,,,\n",
                                         "a");
    expect_places(table, "NDI");
    EXPECT_EQ(table->left_out, 5u);
    EXPECT_NE(refusal("State,Tx,Ty,Tz\nGone,1,2,3\n").find("'Gone'"), std::string::npos);
    const auto kept = parse_point_table("x,y,z\n1,2,3\n,,\n4,5,6\n", "a", {.keep_holes = true});
    ASSERT_EQ(kept->points.size(), 3u);
    EXPECT_TRUE(std::isnan(kept->points[1].x));
}

TEST(PointTable, RowsThatTrackersWriteForNothingAreLeftOut) {
    // What is not seen: a flag, zeros, the number of NDI.
    for (const auto& [names, missed] :
         {std::pair{"x,y,z,valid", "900,0,0,0\n900,0,0,false\n"},
          {"x,y,z,is_tracked", "900,0,0,no\n900,0,0,0\n"},
          {"x,y,z,v", "0,0,0,1\n0.000,-0.0,0,1\n"},
          {"x,y,z,v", "-3.697314E+28,-3.697314E+28,-3.697314E+28,1\n1,2,-3.697314E28,1\n"}}) {
        const std::string text = std::string(names) + "\n" + rows("", ",1", ",") + missed;
        const auto table = parse_point_table(text, "a.csv");
        expect_places(table, names);
        EXPECT_EQ(table->left_out, 2u) << names;
    }
    // One row of zeros may be a place.
    const auto one = parse_point_table("x,y,z\n" + rows("", "", ",") + "0,0,0\n", "a.csv");
    ASSERT_TRUE(one);
    EXPECT_EQ(one->points.size(), 11u);
    PointTableOptions holes;
    holes.keep_holes = true;
    const auto kept =
        parse_point_table("x,y,z\n" + rows("", "", ",") + "0,0,0\n0,0,0\n", "a.csv", holes);
    ASSERT_TRUE(kept);
    ASSERT_EQ(kept->points.size(), 12u);
    EXPECT_TRUE(std::isnan(kept->points[11].x));
}

TEST(PointTable, RowsOfTwoSensorsAreNoOneSurface) {
    const std::string first = rows("1,", "", ","), second = rows("2,", "", ",");
    for (const char* name : {"sensor", "Station", "tool", "Sensor ID", "marker_name"}) {
        const std::string names = std::string(name) + ",x,y,z\n";
        EXPECT_NE(refusal(names + first + second).find("several sensors in one table: 1 and 2"),
                  std::string::npos)
            << name;
        // As the message says: those of one alone.
        expect_places(parse_point_table(names + first, "a.csv"), name);
    }
    // A name for each row is no sensor.
    expect_places(parse_point_table("marker,x,y,z\n" + rows("m%n,", "", ","), "a.csv"), "markers");
}

TEST(PointTable, UnitsAndAxesAreThoseOfTheFileUnlessTold) {
    auto metres = *parse_point_table("X (m),Y (m),Z (m)\n0.1,0.2,0.3\n", "a");
    EXPECT_EQ(metres.unit_mm, 1000);
    auto told = metres;
    place_points(metres, 1, Axes::unsaid);
    EXPECT_LT(distance(metres.points[0], {100, 200, 300}), 1e-9);
    place_points(told, 10, Axes::lps);
    EXPECT_LT(distance(told.points[0], {-1, -2, 3}), 1e-9);

    const char* kHead = "# CoordinateSystem = ";
    for (const auto& [word, axes] : {std::pair<const char*, Axes>{"LPS", Axes::lps},
                                     {"1", Axes::lps},
                                     {"RAS", Axes::ras},
                                     {"0", Axes::ras}}) {
        const auto t = parse_point_table(
            std::string(kHead) + word + "\n# columns = label,x,y,z,sel,vis\nF,1,2,3,1,1\n", "a");
        ASSERT_TRUE(t) << t.error().message();
        EXPECT_EQ(t->axes, axes) << word;
        EXPECT_EQ(t->names.at(0), "F");
    }
    auto slicer = parse_point_table("label,l,p,s,defined\nF,1,2,3,1\n", "a");
    ASSERT_TRUE(slicer) << slicer.error().message();
    place_points(*slicer, 1, Axes::unsaid);
    EXPECT_EQ(slicer->points[0], (Point3{-1, -2, 3}));
}

TEST(PointTable, ReadsMarkups) {
    const auto json = [](const std::string& system, const std::string& unit) {
        return R"({"markups":[{"type":"Fiducial","coordinateSystem":")" + system + R"(",)" +
               (unit.empty() ? "" : R"("coordinateUnits":)" + unit + ",") +
               R"("controlPoints":[
                 {"id":"1","label":"navel","position":[1,2,3],"positionStatus":"defined"},
                 {"id":"2","label":"later","position":[0,0,0],"positionStatus":"undefined"},
                 {"id":"3","label":"none","position":null},
                 {"id":"4","label":"hip","position":[4,5,6]}]}]})";
    };
    auto lps = parse_markups(json("LPS", R"("mm")"), "m.mrk.json");
    ASSERT_TRUE(lps) << lps.error().message();
    EXPECT_EQ(lps->left_out, 2u);
    EXPECT_EQ(lps->names, (std::vector<std::string>{"navel", "hip"}));
    place_points(*lps, 1, Axes::unsaid);
    EXPECT_EQ(lps->points[0], (Point3{-1, -2, 3}));
    auto ras = parse_markups(json("RAS", R"(["cm","cm","cm"])"), "m.mrk.json");
    ASSERT_TRUE(ras) << ras.error().message();
    place_points(*ras, 1, Axes::unsaid);
    EXPECT_LT(distance(ras->points[1], {40, 50, 60}), 1e-9);
    EXPECT_FALSE(parse_markups(json("IJK", ""), "m"));
    EXPECT_FALSE(parse_markups(json("RAS", R"("furlong")"), "m"));
    EXPECT_FALSE(parse_markups("{}", "m"));
    EXPECT_FALSE(parse_markups("[1", "m"));
}

TEST(PointTable, NamesTheLineOfTextThatIsNotUtf8) {
    EXPECT_NE(refusal("name,x,y,z\nHip,1,2,3\nGr\xF6\xDF"
                      "e,4,5,6\n")
                  .find("a.csv:3"),
              std::string::npos);
    EXPECT_NE(refusal(std::string("\xFF\xFEx\0,\0", 6)).find("UTF-16"), std::string::npos);
    EXPECT_EQ(refusal("name,x,y,z\nGr\xC3\xB6\xC3\x9F"
                      "e,1,2,3\n"),
              "read");
}

}  // namespace
}  // namespace sonocase::pipeline
