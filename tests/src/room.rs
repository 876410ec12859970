//! A room for tests that need surfaces: a floor and a wall, without a file beside it.

/// glTF of a floor of four metres and a wall on it, of bytes that the text itself holds.
pub fn room() -> String {
    let corners: [[f32; 3]; 8] = [
        [-2.0, 0.0, -2.0],
        [2.0, 0.0, -2.0],
        [2.0, 0.0, 2.0],
        [-2.0, 0.0, 2.0],
        [-0.5, 0.0, -0.5],
        [0.5, 0.0, -0.5],
        [0.5, 1.2, -0.5],
        [-0.5, 1.2, -0.5],
    ];
    let indices: [u16; 12] = [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7];
    let bytes = corners.iter().flatten().flat_map(|c| c.to_le_bytes());
    let bytes = bytes.chain(indices.iter().flat_map(|i| i.to_le_bytes()));
    let hex: String = bytes.map(|byte| format!("%{byte:02x}")).collect();
    serde_json::json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8, "min": [-2, 0, -2], "max": [2, 1.2, 2] },
            { "bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 12 },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 24 },
        ],
        "buffers": [{ "byteLength": 120, "uri": format!("data:application/octet-stream,{hex}") }],
    })
    .to_string()
}
