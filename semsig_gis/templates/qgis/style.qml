{% import "qgis/layer.xml" as parts %}
<qgis version="3.22.0" styleCategories="LayerConfiguration|Symbology|Labeling|Fields|Forms|MapTips|Actions|AttributeTable|Rendering" {{ parts.attributes(shown) }}>
{{ parts.body(shown, style) }}
</qgis>
