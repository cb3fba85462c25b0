export {
  BoxGeometry, BufferGeometry, CylinderGeometry, DirectionalLight, EdgesGeometry,
  Float32BufferAttribute, GridHelper, Group, HemisphereLight, LineBasicMaterial, LineSegments, Mesh,
  MeshLambertMaterial, PerspectiveCamera, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
