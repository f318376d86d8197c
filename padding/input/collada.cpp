// SPDX-License-Identifier: MIT
// Makes of a COLLADA file one that assimp 5.2 reads as it is meant.
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <pugixml.hpp>
#include <sstream>
#include <string_view>
#include <utility>

#include "padding/asset/excerpt.h"
#include "padding/input/read_internal.h"

namespace padder::reading {
namespace {

using pugi::xml_node;

// Calls `visit` for each element. Not by recursion: a file may nest nodes deeper than the stack.
void for_elements(xml_node document, std::function<void(xml_node)> visit) {
  struct Walker : pugi::xml_tree_walker {
    std::function<void(xml_node)> visit;
    bool for_each(xml_node& node) override {
      if (node.type() == pugi::node_element) visit(node);
      return true;
    }
  } walker;
  walker.visit = std::move(visit);
  document.traverse(walker);
}

// Calls `visit` for each word of the text in an element.
void for_words(xml_node node, const std::function<void(std::string_view)>& visit) {
  constexpr std::string_view blank = " \t\n\v\f\r";
  for (const xml_node part : node.children()) {
    std::string_view rest = part.value();
    for (std::size_t at; (at = rest.find_first_not_of(blank)) < rest.size();) {
      rest.remove_prefix(at);
      const std::string_view word = rest.substr(0, rest.find_first_of(blank));
      rest.remove_prefix(word.size());
      visit(word);
    }
  }
}

void remove_libraries(xml_node collada, std::initializer_list<const char*> libraries) {
  for (const char* library : libraries)
    while (collada.remove_child(library)) {
    }
}

// The physics of a file may have its surfaces as hulls that are written out, which are meshes like others.
void take_hulls_for_meshes(xml_node collada) {
  for_elements(collada, [](xml_node node) {
    if (node.name() == std::string_view("convex_mesh")) node.set_name("mesh");
  });
}

// Skins are not looked at (read_scene.cpp), and assimp crashes on some. What they hold stands in their place.
void take_skins_off(xml_node collada) {
  std::map<std::string, std::string> held;  // "#" and the id of a controller, and what it holds
  for_elements(collada, [&](xml_node node) {
    if (node.name() == std::string_view("controller"))
      for (const xml_node skin : node.children())
        if (const auto source = skin.attribute("source"))
          held.emplace("#" + std::string(node.attribute("id").value()), source.value());
  });
  for_elements(collada, [&](xml_node node) {
    if (node.name() != std::string_view("instance_controller")) return;
    auto url = node.attribute("url");
    auto at = held.find(url.value());
    for (std::size_t step = 0; at != held.end() && step < held.size(); step++)  // they may hold each other
      url = at->second.c_str(), at = held.find(at->second);
    node.set_name("instance_geometry");
  });
  remove_libraries(collada, {"library_controllers"});
}

// assimp takes a unit that is no number for metres, and one below 0 mirrors the part.
void check_unit(xml_node collada, const std::string& where) {
  const auto unit = collada.child("asset").child("unit").attribute("meter");
  std::string_view rest = unit.value();
  double metres = 0;
  const bool is_number = parse_real(next_word(rest), metres) == Number::finite && next_word(rest).empty();
  if (unit && !(is_number && static_cast<float>(metres) > 0))
    fail(where, "its <unit> is of '" + excerpt(unit.value()) +
                    "' metres, and a number above 0 is wanted: mend the attribute `meter`");
}

void refuse_what_is_not_read(xml_node collada, const std::string& where) {
  for_elements(collada, [&](xml_node node) {
    const std::string_view name = node.name(), parent = node.parent().name();
    if (name == "skew" && parent == "node")
      fail(where, "a node is placed by <skew>, which is not read: export it with a <matrix> instead");
    if (name == "ph" && parent == "polygons")
      fail(where, "it has polygons with holes (<ph>), which are not read: export it as triangles");
  });
}

// assimp takes from an array as many values as its `count` says. Behind these it reads what lies in memory.
void check_arrays(xml_node collada, const std::string& where) {
  std::map<std::string, std::uint64_t> sizes;  // by the id
  for_elements(collada, [&](xml_node node) {
    if (!std::string_view(node.name()).ends_with("_array")) return;
    std::uint64_t size = 0;
    for_words(node, [&size](std::string_view) { size++; });
    if (!node.attribute("count")) node.append_attribute("count");
    node.attribute("count") = static_cast<unsigned long long>(size);
    sizes[node.attribute("id").value()] = size;
  });
  for_elements(collada, [&](xml_node node) {
    const std::string_view source = node.attribute("source").value();
    if (node.name() != std::string_view("accessor") || !source.starts_with('#')) return;
    const auto array = sizes.find(std::string(source.substr(1)));
    const std::uint64_t count = node.attribute("count").as_uint(),
                        stride = node.attribute("stride").as_uint(1),
                        offset = node.attribute("offset").as_uint();
    if (array == sizes.end() || count == 0) return;
    std::uint64_t one = 0;  // the values of an item, behind which the array may end
    for (const xml_node param : node.children("param"))
      one += param.attribute("type").value() == std::string_view("float4x4") ? 16 : 1;
    const std::uint64_t wanted = offset + (count - 1) * stride + std::max<std::uint64_t>(one, 1);
    if (wanted > array->second)
      fail(where, "an accessor takes " + std::to_string(wanted) + " values from the array '" +
                      excerpt(array->first) + "', which has " + std::to_string(array->second) +
                      ": the file is damaged, export it again");
  });
}

// assimp takes what is no index for index 0, and comes to no end where letters follow a number.
void check_indices(xml_node collada, const std::string& where) {
  for_elements(collada, [&](xml_node node) {
    const std::string_view name = node.name();
    if (name != "p" && name != "vcount") return;
    for_words(node, [&](std::string_view word) {
      std::int64_t index = 0;
      if (!parse_whole(word, index) || index < 0 || index > std::numeric_limits<std::int32_t>::max())
        fail(where,
             "a <" + excerpt(node.parent().name()) + "> has " + printable(word) + " in its <" +
                 std::string(name) +
                 ">, where an index or a number of corners is wanted: the file is damaged, export it again");
    });
  });
}

// Makes `scene` the scene of the file.
void set_scene(xml_node collada, const std::string& scene) {
  collada.remove_child("scene");
  collada.append_child("scene").append_child("instance_visual_scene").append_attribute("url") =
      ("#" + scene).c_str();
}

// Where no node shows a geometry, all of them are shown where their coordinates say. Returns whether it is
// so. A file that names none of its scenes means the first.
bool show_geometries(xml_node collada) {
  bool shown = false;
  std::vector<std::string> geometries;
  for_elements(collada, [&](xml_node node) {
    const std::string_view name = node.name(), parent = node.parent().name();
    shown |= name == "instance_geometry" && parent == "node";
    if (name == "geometry" && node.child("mesh")) geometries.emplace_back(node.attribute("id").value());
  });
  if (shown) {
    const xml_node first = collada.child("library_visual_scenes").child("visual_scene");
    if (first && !collada.child("scene").child("instance_visual_scene"))
      set_scene(collada, first.attribute("id").value());
    return false;
  }
  if (geometries.empty()) return false;
  xml_node scene = collada.append_child("library_visual_scenes").append_child("visual_scene");
  scene.append_attribute("id") = "all geometries";
  for (const std::string& id : geometries)
    scene.append_child("node").append_child("instance_geometry").append_attribute("url") = ("#" + id).c_str();
  set_scene(collada, "all geometries");
  return true;
}

}  // namespace

std::string plain_collada(const std::string& bytes, std::vector<std::string>& notes,
                          const std::string& where) {
  pugi::xml_document document;
  if (const auto parsed = document.load_buffer(bytes.data(), bytes.size()); !parsed)
    fail(where, std::string("not XML at byte ") + std::to_string(parsed.offset) + " (" +
                    parsed.description() + "): export it again");
  const xml_node collada = document.child("COLLADA");
  // assimp reads no file that has an image without a file, or a colour that begins with a blank.
  remove_libraries(collada, {"library_images", "library_effects", "library_materials", "library_animations",
                             "library_animation_clips"});
  take_hulls_for_meshes(collada);
  take_skins_off(collada);
  refuse_what_is_not_read(collada, where);
  check_unit(collada, where);
  check_arrays(collada, where);
  check_indices(collada, where);
  if (show_geometries(collada))
    notes.push_back(
        std::string("no node of its scene shows a mesh: its meshes are read where their coordinates say") +
        (collada.child("library_physics_models") ? ", and not where its physics puts them" : ""));
  std::ostringstream out;
  document.save(out, "", pugi::format_raw);
  return std::move(out).str();
}

}  // namespace padder::reading
