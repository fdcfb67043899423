// Reads characters and poses of the wire, as docs/wire.md describes them. Compile with -ffp-contract=off.
#pragma once
#define MSGPACK_NO_BOOST
#include <array>
#include <cmath>
#include <map>
#include <msgpack.hpp>
#include <stdexcept>
#include <string>
#include <vector>

using Bytes = std::string;  // a text or a bin
using Object = msgpack::object;
using Map = std::map<Bytes, Object>;
using List = std::vector<Object>;
using Quaternion = std::array<double, 4>;  // w, x, y, z

struct Character {
    int64_t revision;
    bool is_graph;
    std::vector<float> pivots;  // 3 J metres
    std::vector<Bytes> names;  // of the joints where the bones end, or empty
    std::vector<int> order, parents;  // the tree
    Bytes check;
};
struct Transform { Quaternion turn; int stretch[6]; double matrix[3][3], position[3]; };

template <class T> std::vector<T> numbers(const Bytes& bin) {  // the processor must be little-endian
    return {(const T*)bin.data(), (const T*)(bin.data() + bin.size())};
}
template <class T> Bytes bytes(const std::vector<T>& list) {
    return {(const char*)list.data(), list.size() * sizeof(T)};
}

// Returns the CRC-32 of zip and PNG as four bytes.
inline Bytes crc32(const Bytes& data) {
    uint32_t value = ~0u;
    for (size_t bit = 0; bit < 8 * data.size(); bit++) {
        if (bit % 8 == 0) value ^= uint8_t(data[bit / 8]);
        value = value >> 1 ^ (value & 1 ? 0xedb88320u : 0u);
    }
    return bytes(std::vector<uint32_t>{~value});
}

// Returns a character from the map of a CharacterMessage, with the tree of its transforms.
inline Character read_character(Map map) {
    Character c{map["revision"].as<int64_t>(), map["kind"].as<Bytes>() == "graph" && map["held"].is_nil(),
                numbers<float>(map["pivots"].as<Bytes>()), {}, {}, {}, {}};
    if (!map["names"].is_nil()) c.names = map["names"].as<std::vector<Bytes>>();
    const auto edges = numbers<int>(map["edges"].as<Bytes>());
    const int count = int(c.pivots.size() / 3);
    std::vector<double> cost(count, INFINITY);
    c.parents.assign(count, -1);
    for (int node = 0, next; node >= 0; node = next) {  // Prim's algorithm; a cost of -1 marks the tree
        std::vector<double> extra(count, 1e9);
        for (size_t e = 0; e < edges.size(); e++) if (edges[e] == node) extra[edges[e ^ 1]] = 0;
        c.order.push_back(node), cost[node] = next = -1;
        for (int j = 0; j < count; j++) {
            if (cost[j] < 0) continue;
            double d[3];
            for (int a = 0; a < 3; a++) d[a] = double(c.pivots[3 * j + a]) - c.pivots[3 * node + a];
            const double price = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + extra[j];
            if (price < cost[j]) cost[j] = price, c.parents[j] = node;
            if (next < 0 || cost[j] < cost[next]) next = j;
        }
    }
    c.check = crc32(bytes(c.pivots) + bytes(c.order) + bytes(c.parents));
    return c;
}

// Returns a row of 12 integers for each transform. Throws std::out_of_range for truncated bytes.
inline std::vector<std::array<int, 12>> read_table(const Bytes& data, size_t rows) {
    std::vector<std::array<int, 12>> table(rows);
    size_t at = 8 * 4;  // the bit after the check bytes
    auto bits = [&](int count) {
        unsigned value = 0;
        for (; count > 0; count--, at++) value = value << 1 | (uint8_t(data.at(at / 8)) >> (7 - at % 8) & 1);
        return value;
    };
    for (int column = 0, k; column < 12; column++) {
        if ((k = int(bits(4))) == 15) continue;
        for (auto& row : table) {
            unsigned q = 0;
            while (q < 12 && bits(1)) q++;
            const int u = int(q < 12 ? q << k | bits(k) : bits(22));
            row[column] = u % 2 ? -(u + 1) / 2 : u / 2;
        }
    }
    return table;
}

inline Quaternion multiply(const Quaternion& a, const Quaternion& b) {
    const auto [s, i, j, k] = b;
    return {a[0] * s - a[1] * i - a[2] * j - a[3] * k, a[0] * i + a[1] * s + a[2] * k - a[3] * j,
            a[0] * j - a[1] * k + a[2] * s + a[3] * i, a[0] * k + a[1] * j - a[2] * i + a[3] * s};
}

// Returns the transforms of a pose. Throws if the bytes are damaged or belong to another revision.
inline std::vector<Transform> read_pose(const Character& c, const Bytes& data) {
    if (data.substr(0, 4) != c.check) throw std::runtime_error("the pose belongs to another revision");
    const auto table = read_table(data, c.order.size());
    const Transform identity{{1, 0, 0, 0}, {}, {}, {}};
    std::vector<Transform> pose(table.size());
    for (size_t number = 0; number < table.size(); number++) {
        const auto& row = table[number];
        const int i = c.order[number], up = c.parents[i];
        const Transform& parent = up < 0 ? identity : pose[up];
        Transform& t = pose[i];
        const double x = row[3] / 1024.0, y = row[4] / 1024.0, z = row[5] / 1024.0;
        const double angle = std::hypot(x, y, z);
        const double f = angle > 0 ? std::sin(angle / 2) / angle : 0.5;
        t.turn = multiply(parent.turn, {std::cos(angle / 2), f * x, f * y, f * z});
        const double length = std::hypot(std::hypot(t.turn[0], t.turn[1], t.turn[2]), t.turn[3]);
        for (double& value : t.turn) value /= length;
        const Quaternion inverse{t.turn[0], -t.turn[1], -t.turn[2], -t.turn[3]};
        double s[6];
        for (int n = 0; n < 6; n++) s[n] = (t.stretch[n] = parent.stretch[n] + row[6 + n]) / 512.0;
        const double stretch[3][3] = {{1 + s[0], s[3], s[4]}, {s[3], 1 + s[1], s[5]}, {s[4], s[5], 1 + s[2]}};
        for (int b = 0; b < 3; b++) {  // turn each column of the stretch
            const Quaternion column{0, stretch[0][b], stretch[1][b], stretch[2][b]};
            const Quaternion turned = multiply(multiply(t.turn, column), inverse);
            for (int a = 0; a < 3; a++) t.matrix[a][b] = turned[a + 1];
        }
        for (int a = 0; a < 3; a++) {
            t.position[a] = row[a] / 4096.0 + (up < 0 ? c.pivots[3 * i + a] : parent.position[a]);
            for (int b = 0; b < 3 && up >= 0; b++) {
                const double other = c.is_graph ? t.matrix[a][b] : parent.matrix[a][b];
                const double m = (parent.matrix[a][b] + other) / 2;
                t.position[a] += m * (double(c.pivots[3 * i + b]) - c.pivots[3 * up + b]);
            }
        }
    }
    return pose;
}
